// `final` of scenes with exact spheres.
#define CURITIBA_SPHERES
#define CURITIBA_OF_FINAL
#include "glass.cpp"
