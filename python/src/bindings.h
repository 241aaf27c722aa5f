// What each file adds to the module.
#pragma once

#include <pybind11/pybind11.h>

namespace surfeit::python {

void addClouds(pybind11::module_& module);
void addEngine(pybind11::module_& module);
void addJobs(pybind11::module_& module);

}  // namespace surfeit::python
