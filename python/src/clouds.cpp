// Clouds as columns: surfeit/cloud_rows.h.
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "arrays.h"
#include "bindings.h"
#include "call.h"
#include "errors.h"
#include "options.h"
#include "surfeit/cloud_rows.h"

namespace surfeit::python {
namespace {

CloudInput openInput(const std::string& path, const py::dict& given) {
  Options options(given);
  ReadOptions reading;
  takeReading(options, reading);
  options.finish();
  return runFor<CloudInput>(py::none(), [&](Progress&) { return CloudInput::open(path, reading); });
}

std::size_t readRows(CloudInput& input, std::size_t most, const py::list& arrays) {
  const std::vector<ColumnTarget> targets = targetsOf(arrays, input.columns(), most);
  return runFor<std::size_t>(py::none(),
                             [&](Progress&) { return input.read(most, targets.data()); });
}

py::list columnsOf(const CloudInput& input) {
  py::list list;
  for (const CloudColumn& column : input.columns()) {
    list.append(py::make_tuple(column.name, dtypeOf(column.type)));
  }
  return list;
}

py::list channelsOfCloud(const CloudInput& input) {
  py::list list;
  for (const CloudChannel& channel : input.channels()) {
    list.append(py::make_tuple(channel.name, channel.properties));
  }
  return list;
}

// Keeps what it is told; Python asks for it after each call.
class KeptNotes : public Progress {
 public:
  void note(const std::string& message) override { notes.push_back(message); }
  std::vector<std::string> notes;
};

// An output whose progress outlives it.
class OutputFile {
 public:
  OutputFile(const std::string& path, const Columns& first, const py::dict& given)
      : progress_(std::make_unique<KeptNotes>()) {
    Options options(given);
    CloudOutputOptions writing;
    options.into("count", writing.count);
    options.into("comments", writing.comments);
    options.into("memory", writing.memory_bytes);
    takeUp(options, "up", writing.up);
    options.finish();
    columns_ = first.columns;
    output_.emplace(valueOf(CloudOutput::create(path, columns_, writing, *progress_)));
  }

  void write(const py::list& given) {
    const Columns chunk(given);
    bool fits = chunk.columns.size() == columns_.size();
    for (std::size_t i = 0; fits && i < columns_.size(); ++i) {
      fits = chunk.columns[i].name == columns_[i].name && chunk.columns[i].type == columns_[i].type;
    }
    if (!fits) throw py::value_error("a chunk has other columns than the first one");
    run(py::none(), [&](Progress&) { return output_->write(chunk.count, chunk.values.data()); });
  }

  void finish() {
    run(py::none(), [&](Progress&) { return output_->finish(); });
    output_.reset();
  }

  std::vector<std::string> notes() { return std::exchange(progress_->notes, {}); }

 private:
  std::unique_ptr<KeptNotes> progress_;
  std::vector<CloudColumn> columns_;
  std::optional<CloudOutput> output_;
};

}  // namespace

void addClouds(py::module_& module) {
  py::class_<CloudInput>(module, "CloudInput")
      .def(py::init(&openInput))
      .def("read", &readRows)
      .def_property_readonly("format", &CloudInput::format)
      .def_property_readonly("count", &CloudInput::count)
      .def_property_readonly("columns", &columnsOf)
      .def_property_readonly("channels", &channelsOfCloud)
      .def_property_readonly("comments", &CloudInput::comments)
      .def_property_readonly("notes", &CloudInput::notes);
  py::class_<OutputFile>(module, "CloudOutput")
      .def(py::init([](const std::string& path, const py::list& first, const py::dict& options) {
        return OutputFile(path, Columns(first), options);
      }))
      .def("write", &OutputFile::write)
      .def("finish", &OutputFile::finish)
      .def("notes", &OutputFile::notes);
}

}  // namespace surfeit::python
