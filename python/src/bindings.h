// What each file adds to the module.
#pragma once

#include <pybind11/pybind11.h>

namespace surfeit::python {

void addBakes(pybind11::module_& module);
void addClouds(pybind11::module_& module);
void addEngine(pybind11::module_& module);
void addGathering(pybind11::module_& module);
void addIndexing(pybind11::module_& module);
void addJobs(pybind11::module_& module);
// Of components that a build may lack: then they add nothing.
void addMeshes(pybind11::module_& module);
void addPictures(pybind11::module_& module);

}  // namespace surfeit::python
