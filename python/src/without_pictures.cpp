// In place of pictures.cpp where the component `view` is not built.
#include "bindings.h"

namespace surfeit::python {

void addPictures(pybind11::module_&) {}

}  // namespace surfeit::python
