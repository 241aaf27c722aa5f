#include "arrays.h"

#include <pybind11/stl.h>

#include <cstring>
#include <optional>

#include "errors.h"

namespace surfeit::python {
namespace {

constexpr struct {
  ColumnType type;
  char kind;
  std::size_t bytes;
  const char* name;
} kTypes[] = {{ColumnType::kInt8, 'i', 1, "int8"},       {ColumnType::kUint8, 'u', 1, "uint8"},
              {ColumnType::kInt16, 'i', 2, "int16"},     {ColumnType::kUint16, 'u', 2, "uint16"},
              {ColumnType::kInt32, 'i', 4, "int32"},     {ColumnType::kUint32, 'u', 4, "uint32"},
              {ColumnType::kFloat32, 'f', 4, "float32"}, {ColumnType::kFloat64, 'f', 8, "float64"}};

bool isNative(const py::dtype& type) {
  const char order = py::cast<std::string>(type.attr("byteorder"))[0];
  return order == '=' || order == '|';
}

std::optional<ColumnType> columnTypeOf(const py::dtype& type) {
  if (!isNative(type)) return std::nullopt;
  for (const auto& row : kTypes) {
    if (type.kind() == row.kind && std::size_t(type.itemsize()) == row.bytes) return row.type;
  }
  return std::nullopt;
}

std::string describe(const py::array& array) {
  return py::cast<std::string>(py::str(array.attr("dtype"))) + " of shape " +
         py::cast<std::string>(py::str(array.attr("shape")));
}

[[noreturn]] void refuse(const std::string& message) { throw py::value_error(message); }

py::array asArray(const py::object& given, const char* name) {
  py::array array = py::array::ensure(given);
  if (!array) {
    PyErr_Clear();
    refuse(std::string(name) + ": found no array of numbers");
  }
  const std::optional<ColumnType> type = columnTypeOf(array.dtype());
  if (type == ColumnType::kFloat32 || type == ColumnType::kFloat64) return array;
  if (std::strchr("iufb", array.dtype().kind()) == nullptr) {
    refuse(std::string(name) + ": found " + describe(array) + ", expected numbers");
  }
  return py::array_t<double, py::array::c_style | py::array::forcecast>::ensure(array);
}

struct OutputShape {
  std::uint32_t output;
  std::size_t begin, floats;
};

template <typename Member>
std::size_t floatsBefore(Member GatherResult::*member) {
  const GatherResult result;
  return std::size_t(reinterpret_cast<const std::byte*>(&(result.*member)) -
                     reinterpret_cast<const std::byte*>(&result)) /
         sizeof(float);
}

std::vector<OutputShape> outputShapes() {
  return {{kOutputOcclusion, floatsBefore(&GatherResult::occlusion), 1},
          {kOutputIrradiance, floatsBefore(&GatherResult::irradiance), 3},
          {kOutputBentNormal, floatsBefore(&GatherResult::bent_normal), 3},
          {kOutputIlluminationDirection, floatsBefore(&GatherResult::illumination_direction), 3},
          {kOutputEnvironment, floatsBefore(&GatherResult::environment), 3},
          {kOutputFluence, floatsBefore(&GatherResult::fluence), 3},
          {kOutputRadianceSh, floatsBefore(&GatherResult::radiance_sh), 27}};
}

std::vector<py::ssize_t> shapeOf(std::size_t count, std::size_t floats) {
  const auto n = py::ssize_t(count);
  if (floats == 1) return {n};
  if (floats == 3) return {n, 3};
  return {n, 9, 3};
}

// The array to fill under `word`, new or of the caller.
py::array outputArray(const py::object& given, const std::string& word,
                      const std::vector<py::ssize_t>& shape) {
  if (given.is_none() || !given.contains(word.c_str())) return py::array_t<float>(shape);
  const py::array array = py::cast<py::array>(given[word.c_str()]);
  const bool fits = columnTypeOf(array.dtype()) == ColumnType::kFloat32 && array.writeable() &&
                    (array.flags() & py::array::c_style) != 0 &&
                    std::vector<py::ssize_t>(array.shape(), array.shape() + array.ndim()) == shape;
  if (!fits) {
    refuse("out[\"" + word + "\"]: found " + describe(array) +
           ", expected writable contiguous float32 of shape " +
           py::cast<std::string>(py::str(py::tuple(py::cast(shape)))));
  }
  return array;
}

}  // namespace

Vectors::Vectors(const py::object& given, const char* name) {
  if (given.is_none()) return;
  array_ = asArray(given, name);
  if (array_.ndim() != 2 || array_.shape(1) != 3) {
    refuse(std::string(name) + ": found " + describe(array_) + ", expected shape (n, 3)");
  }
  data_ = static_cast<const std::byte*>(array_.data());
  count_ = std::size_t(array_.shape(0));
  row_stride_ = array_.strides(0);
  column_stride_ = array_.strides(1);
  is_double_ = array_.itemsize() == sizeof(double);
}

ReceiverColumns::ReceiverColumns(const py::object& positions, const py::object& normals,
                                 const py::object& views, std::uint32_t outputs,
                                 const py::object& given)
    : positions_(positions, "positions"), normals_(normals, "normals"), views_(views, "views") {
  if (!positions_.isThere()) refuse("positions: found None, expected shape (n, 3)");
  for (const auto& [vectors, name] :
       {std::pair(&normals_, "normals"), std::pair(&views_, "views")}) {
    if (!vectors->isThere() || vectors->count() == count()) continue;
    refuse(std::string(name) + ": found " + std::to_string(vectors->count()) + ", expected " +
           std::to_string(count()) + " as of positions");
  }
  for (const OutputShape& shape : outputShapes()) {
    if ((outputs & shape.output) == 0) continue;
    const std::string word = describeOutputs(shape.output);
    py::array array = outputArray(given, word, shapeOf(count(), shape.floats));
    auto* const data = static_cast<float*>(array.mutable_data());
    targets_.push_back({data, shape.floats, shape.begin});
    static_assert(sizeof(glm::vec3) == 3 * sizeof(float));
    if (shape.output == kOutputIrradiance) irradiance_ = reinterpret_cast<glm::vec3*>(data);
    results_[word.c_str()] = std::move(array);
  }
}

Receiver ReceiverColumns::receiver(std::size_t index) const {
  Receiver receiver;
  receiver.position = positions_[index];
  if (normals_.isThere()) receiver.normal = glm::vec3(normals_[index]);
  if (views_.isThere()) receiver.view = glm::vec3(views_[index]);
  return receiver;
}

void ReceiverColumns::setResult(std::size_t index, const GatherResult& result) {
  const auto* const floats = reinterpret_cast<const float*>(&result);
  for (const Target& target : targets_) {
    std::memcpy(target.data + index * target.floats, floats + target.begin,
                target.floats * sizeof(float));
  }
}

Columns::Columns(const py::list& given) {
  bool is_first = true;
  for (const py::handle& each : given) {
    const auto pair = py::cast<py::tuple>(each);
    const auto name = py::cast<std::string>(pair[0]);
    const auto array = py::cast<py::array>(pair[1]);
    const std::optional<ColumnType> type = columnTypeOf(array.dtype());
    if (array.ndim() != 1 || !type) {
      refuse(name + ": found " + describe(array) +
             ", expected numbers of up to 32 bits or float64");
    }
    if (!is_first && std::size_t(array.shape(0)) != count) {
      refuse(name + ": found " + std::to_string(array.shape(0)) + " values, expected " +
             std::to_string(count) + " as of the others");
    }
    count = std::size_t(array.shape(0));
    is_first = false;
    columns.push_back({name, *type});
    values.push_back({array.data(), array.strides(0)});
    held.push_back(array);
  }
}

std::vector<ColumnTarget> targetsOf(const py::list& arrays, const std::vector<CloudColumn>& columns,
                                    std::size_t rows) {
  if (arrays.size() != columns.size()) refuse("targets: expected one for each column, or None");
  std::vector<ColumnTarget> targets(columns.size());
  for (std::size_t i = 0; i < columns.size(); ++i) {
    if (arrays[i].is_none()) continue;
    auto array = py::cast<py::array>(arrays[i]);
    const bool fits = array.ndim() == 1 && std::size_t(array.shape(0)) >= rows &&
                      array.writeable() && columnTypeOf(array.dtype()) == columns[i].type;
    if (!fits) refuse(columns[i].name + ": found " + describe(array) + ", which does not fit");
    targets[i] = {array.mutable_data(), array.strides(0)};
  }
  return targets;
}

py::dtype dtypeOf(ColumnType type) { return py::dtype(kTypes[std::size_t(type)].name); }

}  // namespace surfeit::python
