#pragma once
// What the benchmarks share.

#include <algorithm>
#include <cerrno>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <utility>
#include <vector>

#include "core/result.h"

namespace ivis::bench {

/// CPU time of the calling thread.
inline double cpu_ms() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) * 1e3 + static_cast<double>(t.tv_nsec) * 1e-6;
}

/// The upper one of an even number.
inline double median(std::vector<double> v) {
  std::nth_element(v.begin(), v.begin() + static_cast<std::ptrdiff_t>(v.size() / 2), v.end());
  return v[v.size() / 2];
}

/// Ends the program with the error, if it is one.
template <class T>
T get(Result<T> r) {
  if (!r) {
    std::fprintf(stderr, "%s: %s\n", program_invocation_short_name, r.error().message.c_str());
    std::exit(3);
  }
  return std::move(*r);
}

}  // namespace ivis::bench
