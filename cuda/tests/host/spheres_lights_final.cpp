// `final` of scenes with exact spheres and several lights.
#define CURITIBA_SPHERES
#define CURITIBA_LIGHTS
#define CURITIBA_OF_FINAL
#include "glass.cpp"
