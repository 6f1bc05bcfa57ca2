// `deferredShadows` of several lights, and of lights with a place.
#define CURITIBA_LIGHTS
#define CURITIBA_OF_SHADOWS
#include "glass.cpp"
