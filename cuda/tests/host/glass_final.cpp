// `final`, as `glass.cpp` has `refraction`.
#define CURITIBA_OF_FINAL
#include "glass.cpp"
