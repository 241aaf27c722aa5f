// Arrays of numpy as the library sees them: receivers, results, columns of clouds. Nothing is
// copied where numbers are float32 or float64; others become float64.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <string>
#include <vector>

#include "surfeit/cloud_rows.h"
#include "surfeit/engine.h"

namespace surfeit::python {

namespace py = pybind11;

// An array of n vectors, shape (n, 3), with any strides; or none. Holds a reference to the array;
// reads need no GIL.
class Vectors {
 public:
  Vectors() = default;
  // None gives none. Raises ValueError for another shape; `name` is the argument's.
  Vectors(const py::object& given, const char* name);

  bool isThere() const { return data_ != nullptr; }
  std::size_t count() const { return count_; }
  glm::dvec3 operator[](std::size_t i) const {
    const std::byte* const row = data_ + std::ptrdiff_t(i) * row_stride_;
    return is_double_
               ? glm::dvec3(number<double>(row, 0), number<double>(row, 1), number<double>(row, 2))
               : glm::dvec3(number<float>(row, 0), number<float>(row, 1), number<float>(row, 2));
  }

 private:
  template <typename T>
  double number(const std::byte* row, std::ptrdiff_t column) const {
    T value;
    __builtin_memcpy(&value, row + column * column_stride_, sizeof value);
    return double(value);
  }

  py::array array_;
  const std::byte* data_ = nullptr;
  std::size_t count_ = 0;
  std::ptrdiff_t row_stride_ = 0, column_stride_ = 0;
  bool is_double_ = false;
};

// Receivers in three arrays, and results in an array for each output.
class ReceiverColumns : public ReceiverArray {
 public:
  // `outputs`: set of GatherOutput. `given`: a dict of arrays to fill, or None to make them.
  ReceiverColumns(const py::object& positions, const py::object& normals, const py::object& views,
                  std::uint32_t outputs, const py::object& given);

  std::size_t count() const override { return positions_.count(); }
  Receiver receiver(std::size_t index) const override;
  void setResult(std::size_t index, const GatherResult& result) override;

  // Arrays by the words of the outputs: float32, (n,), (n, 3) or (n, 9, 3).
  const py::dict& results() const { return results_; }
  // The irradiance among them, in the order of the receivers; null where it is no output.
  glm::vec3* irradiance() const { return irradiance_; }

 private:
  struct Target {
    float* data;
    std::size_t floats;  // of a receiver
    std::size_t begin;   // in a GatherResult, in floats
  };

  Vectors positions_, normals_, views_;
  py::dict results_;
  std::vector<Target> targets_;
  glm::vec3* irradiance_ = nullptr;
};

// Columns as a list of (name, array of one dimension), all of one length. Holds references.
struct Columns {
  explicit Columns(const py::list& given);
  std::vector<CloudColumn> columns;
  std::vector<ColumnValues> values;
  std::size_t count = 0;
  std::vector<py::array> held;
};

// Targets for `rows` values of each column, from arrays of one dimension or None.
std::vector<ColumnTarget> targetsOf(const py::list& arrays, const std::vector<CloudColumn>& columns,
                                    std::size_t rows);

py::dtype dtypeOf(ColumnType type);

}  // namespace surfeit::python
