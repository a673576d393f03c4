#pragma once
// Replaces operator new of the test that links it by one that can fail.

namespace ivis::test {

/// Of this thread, until one fails, and all that follow; below 0: none does.
extern thread_local int allocations_left;

}  // namespace ivis::test
