#pragma once

#include <cstdio>
#include <cstdlib>

/// For a programmer's mistake only; bad input is a Result. Active in every build type.
#define IVIS_ASSERT(cond, meaning)                                                        \
  do {                                                                                    \
    if (!(cond)) {                                                                        \
      std::fprintf(stderr, "ivis: %s:%d: %s (%s)\n", __FILE__, __LINE__, meaning, #cond); \
      std::abort();                                                                       \
    }                                                                                     \
  } while (false)
