// `ssao` of scenes with exact spheres.
#define CURITIBA_SPHERES
#define CURITIBA_OF_OCCLUSION
#include "glass.cpp"
