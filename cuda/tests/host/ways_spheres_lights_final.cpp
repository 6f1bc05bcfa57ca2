// The same with several lights.
#define CURITIBA_WAYS
#define CURITIBA_SPHERES
#define CURITIBA_LIGHTS
#define CURITIBA_OF_FINAL
#include "glass.cpp"
