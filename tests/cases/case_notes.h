// What the library tells while a case is read.
#pragma once

#include <string>
#include <vector>

#include "surfeit/progress.h"

namespace surfeit {

class Notes : public Progress {
 public:
  void note(const std::string& message) override { notes.push_back(message); }
  std::vector<std::string> notes;
};

}  // namespace surfeit
