// `refraction` that follows paths through all glass.
#define CURITIBA_WAYS
#include "glass.cpp"
