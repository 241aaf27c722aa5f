#include "bench/internal/cache_designs.h"

namespace surfeit {

std::vector<NamedDesign> rocksDbDesigns() { return {}; }

}  // namespace surfeit
