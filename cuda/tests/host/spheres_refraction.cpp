// `refraction` of scenes with exact spheres.
#define CURITIBA_SPHERES
#include "glass.cpp"
