// In place of meshes.cpp where the component `sample` is not built.
#include "bindings.h"

namespace surfeit::python {

void addMeshes(pybind11::module_&) {}

}  // namespace surfeit::python
