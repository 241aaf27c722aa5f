// Whether commas in a text of points part values or stand before decimals: 418,446;50,290;4,725.
#pragma once

#include <string>

#include "cloud/text/text_rows.h"
#include "surfeit/status.h"

namespace surfeit {

// kUnknown: no comma has been seen.
enum class TextDecimals { kUnknown, kPoint, kComma };

// Judges the lines from here on, all of them where a few do not settle it:
//   only commas between values                                         kPoint
//   semicolons, tabs or blanks between values, commas within them      kComma
// kCorruption when several readings are possible, which the message has: commas that may group
// thousands (1,234 2,345 3,456), pairs of whole numbers that may be numbers with decimals
// (418,446,50,290,4,725), commas and others that both part values.
// Where columns have names, their number tells pairs. `all_lines`: although a few settle it.
Result<TextDecimals> judgeDecimals(LineSource& source, bool has_names, bool all_lines = false);

}  // namespace surfeit
