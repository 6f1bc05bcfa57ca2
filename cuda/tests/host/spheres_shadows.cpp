// `deferredShadows` of scenes with exact spheres.
#define CURITIBA_SPHERES
#define CURITIBA_OF_SHADOWS
#include "glass.cpp"
