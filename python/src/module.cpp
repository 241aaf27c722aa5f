// The module surfeit._surfeit: the library as plainly as Python can call it. The package surfeit
// stands on it and is what users see.
#include <malloc.h>
#include <pybind11/pybind11.h>

#include "bindings.h"
#include "surfeit/process.h"
#include "surfeit/version.h"

PYBIND11_MODULE(_surfeit, module) {
#ifdef __GLIBC__
  // Else blocks of up to 32 MiB come to lie in heaps of threads, which keep them: an index of 2 M
  // points left 75 MiB, now 5
  mallopt(M_MMAP_THRESHOLD, 16 << 20);
#endif
  module.doc() = "The surfeit library. Use the package surfeit instead.";
  module.attr("__version__") = surfeit::kVersion;
  module.def("memory_limit", &surfeit::memoryLimitBytes);
  module.def("peak_resident", &surfeit::peakResidentBytes);
  module.def("default_threads", &surfeit::defaultThreadCount);
  module.def("set_read_retries", &surfeit::setReadRetries);
  surfeit::python::addBakes(module);
  surfeit::python::addClouds(module);
  surfeit::python::addEngine(module);
  surfeit::python::addGathering(module);
  surfeit::python::addIndexing(module);
  surfeit::python::addJobs(module);
  surfeit::python::addMeshes(module);
  surfeit::python::addPictures(module);
}
