// What the provenance of a scene says of its clouds.
#pragma once

#include <string>
#include <vector>

#include "surfeit/group_names.h"

namespace surfeit {

// Names of object groups, in rising order. What is not as we write it is left out.
std::vector<GroupName> groupNamesOf(const std::string& provenance);

// The coordinate reference system; empty where none is known.
std::string sceneCrs(const std::string& provenance);

}  // namespace surfeit
