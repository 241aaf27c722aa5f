// The fuzzer of everything that is read: `read_cloud_fuzzer --format=NAME [options of libFuzzer]`,
// NAME being one of fuzz/probe.h. README.md has how to run it.
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <span>
#include <string_view>

#include "fuzz/probe.h"

namespace {

const surfeit::Probe* probe = nullptr;

}  // namespace

extern "C" int LLVMFuzzerInitialize(int* argc, char*** argv);
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

// libFuzzer itself passes over options of two dashes.
extern "C" int LLVMFuzzerInitialize(int* argc, char*** argv) {
  constexpr std::string_view kOption = "--format=";
  for (int i = 1; i < *argc; ++i) {
    const std::string_view argument = (*argv)[i];
    if (argument.starts_with(kOption)) probe = surfeit::findProbe(argument.substr(kOption.size()));
  }
  if (probe == nullptr) {
    std::fprintf(stderr, "read_cloud_fuzzer: expected --format=NAME, NAME being one of:");
    for (const surfeit::Probe& known : surfeit::probes()) {
      std::fprintf(stderr, " %.*s", static_cast<int>(known.name.size()), known.name.data());
    }
    std::fprintf(stderr, "\n");
    std::exit(2);
  }
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  surfeit::probeBytes(*probe, std::as_bytes(std::span(data, size)));
  return 0;
}
