// `refraction` of several lights, and of lights with a place.
#define CURITIBA_LIGHTS
#include "glass.cpp"
