// `reflection` of several lights, and of lights with a place.
#define CURITIBA_LIGHTS
#define CURITIBA_OF_MIRRORS
#include "glass.cpp"
