// What the fuzzers and the replay of their corpora do with bytes from anywhere: read them as a
// file of one format, to the end, in every way that a reader offers. A probe returns whatever the
// bytes are; that a reader breaks its contract (cloud/rows/row_reader.h) ends the process.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>

namespace surfeit {

struct Probe {
  std::string_view name;  // "ply"; its corpus is fuzz/corpus/NAME
  // Reads the file of that path.
  void (*read)(const std::string& path);
};

// One per format. The format is not chosen by the first bytes but given, so that each is probed by
// all that its fuzzer makes up.
std::span<const Probe> probes();

// The probe of that name, or nullptr.
const Probe* findProbe(std::string_view name);

// Reads the bytes as a file: one without a name, in memory. One thread at a time.
void probeBytes(const Probe& probe, std::span<const std::byte> bytes);

}  // namespace surfeit
