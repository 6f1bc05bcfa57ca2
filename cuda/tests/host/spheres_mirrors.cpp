// `reflection` of scenes with exact spheres.
#define CURITIBA_SPHERES
#define CURITIBA_OF_MIRRORS
#include "glass.cpp"
