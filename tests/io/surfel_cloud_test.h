// What the tests of surfel clouds share.
#pragma once

#include <gtest/gtest.h>

#include <cstddef>
#include <memory>
#include <random>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "io/test_directory.h"
#include "surfels/open_surfel_source.h"
#include "surfels/rows/surfel_writer.h"

namespace surfeit {

// Valid surfels of all channels that survive a file bit for bit.
inline std::vector<Surfel> randomSurfels(std::size_t count) {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> uniform(0.001f, 1);
  std::vector<Surfel> surfels(count);
  for (std::size_t i = 0; i < count; ++i) {
    Surfel& surfel = surfels[i];
    for (int axis = 0; axis < 3; ++axis) {
      surfel.position[axis] = 100 * uniform(random) - 50;
      surfel.radiosity[axis] = uniform(random);
      surfel.albedo[axis] = uniform(random);
    }
    surfel.radius = uniform(random);
    surfel.area = uniform(random);
    // Axes survive normalisation bit for bit
    if (i % 4 == 0) {
      surfel.flags |= kSurfelSphere;
    } else {
      surfel.normal[int(i % 3)] = i % 2 == 0 ? 1.0f : -1.0f;
    }
    if (i % 5 == 0) surfel.flags |= kSurfelTwoSided;
  }
  return surfels;
}

// Clouds in files, and what they hold.
class SurfelCloudTest : public DirectoryTest {
 protected:
  // An ascii cloud of the given properties ("float x") and rows.
  std::string cloud(const std::vector<std::string>& properties,
                    const std::vector<std::string>& rows, const std::string& element = "vertex") {
    std::string text =
        "ply\nformat ascii 1.0\nelement " + element + " " + std::to_string(rows.size()) + "\n";
    for (const std::string& property : properties) text += "property " + property + "\n";
    text += "end_header\n";
    for (const std::string& row : rows) text += row + "\n";
    write("a.ply", text);
    return path("a.ply");
  }

  std::unique_ptr<SurfelSource> open(const std::string& file, bool strict = false) {
    Result<std::unique_ptr<SurfelSource>> source = openSurfelSource(file, strict);
    EXPECT_TRUE(source.ok()) << source.status().message();
    return source.ok() ? std::move(*source) : nullptr;
  }

  std::vector<Surfel> readAll(SurfelSource& source, std::size_t batch = 1000) {
    std::vector<Surfel> all, surfels(batch);
    for (;;) {
      const Result<std::size_t> count = source.read(surfels);
      EXPECT_TRUE(count.ok()) << count.status().message();
      if (!count.ok() || *count == 0) return all;
      all.insert(all.end(), surfels.begin(), surfels.begin() + std::ptrdiff_t(*count));
    }
  }

  Surfel readOne(const std::string& file) {
    const std::vector<Surfel> surfels = readAll(*open(file));
    EXPECT_EQ(surfels.size(), 1u);
    return surfels.empty() ? Surfel{} : surfels[0];
  }

  std::string refusal(const std::string& file) {
    const Result<std::unique_ptr<SurfelSource>> source = openSurfelSource(file, false);
    if (source.ok()) return "accepted";
    EXPECT_EQ(source.status().code(), StatusCode::kCorruption);
    return source.status().message();
  }

  const std::vector<std::string> kXyz = {"float x", "float y", "float z"};

  std::vector<std::string> xyzAnd(const std::vector<std::string>& more) const {
    std::vector<std::string> all = kXyz;
    all.insert(all.end(), more.begin(), more.end());
    return all;
  }
};

}  // namespace surfeit
