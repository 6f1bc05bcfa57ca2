// `ssao`.
#define CURITIBA_OF_OCCLUSION
#include "glass.cpp"
