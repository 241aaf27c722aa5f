// SURFEIT_ASSERT (debug builds) and SURFEIT_CHECK (always) state facts that only a bug can break.
// Input never trips them: what comes from outside is a Status.
#pragma once

#include <cstdio>
#include <cstdlib>

#define SURFEIT_CHECK(condition)                                                        \
  do {                                                                                  \
    if (!(condition)) {                                                                 \
      std::fprintf(stderr, "surfeit bug: %s:%d: %s\n", __FILE__, __LINE__, #condition); \
      std::abort();                                                                     \
    }                                                                                   \
  } while (false)

#ifdef NDEBUG
// Not evaluated, but names in it count as used
#define SURFEIT_ASSERT(condition) static_cast<void>(sizeof(!(condition)))
#else
#define SURFEIT_ASSERT(condition) SURFEIT_CHECK(condition)
#endif
