// `final` that follows paths through all glass, as our own traversal has it, which knows exact spheres.
#define CURITIBA_WAYS
#define CURITIBA_SPHERES
#define CURITIBA_OF_FINAL
#include "glass.cpp"
