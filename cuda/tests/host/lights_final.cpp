// `final` of several lights, and of lights with a place.
#define CURITIBA_LIGHTS
#define CURITIBA_OF_FINAL
#include "glass.cpp"
