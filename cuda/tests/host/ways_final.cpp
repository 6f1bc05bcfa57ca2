// `final` that follows paths through all glass.
#define CURITIBA_WAYS
#define CURITIBA_OF_FINAL
#include "glass.cpp"
