#pragma once

#include <string>
#include <utility>
#include <variant>

#include "core/assert.h"

namespace ivis {

enum class ErrorCode {
  kInvalidArgument,  ///< a value the caller gave is out of range or does not fit the others
  kInput,            ///< a file's or message's bytes are not what they should be
  kIo,               ///< a file cannot be opened, read or written
  kMismatch,         ///< two things that must belong together do not (scene hash, version, reach)
  kUnsupported,      ///< valid, but not taken here (an unknown required extension)
  kConnection,       ///< a peer is absent, silent, or gone
  kCancelled,        ///< the caller asked to stop
};

const char* to_string(ErrorCode code);

/// Message names the thing and the value: file, node, expected, found.
struct Error {
  ErrorCode code = ErrorCode::kInvalidArgument;
  std::string message;
};

inline Error invalid_argument(std::string m) {
  return {ErrorCode::kInvalidArgument, std::move(m)};
}
inline Error input_error(std::string m) {
  return {ErrorCode::kInput, std::move(m)};
}
inline Error io_error(std::string m) {
  return {ErrorCode::kIo, std::move(m)};
}
inline Error mismatch(std::string m) {
  return {ErrorCode::kMismatch, std::move(m)};
}
inline Error unsupported(std::string m) {
  return {ErrorCode::kUnsupported, std::move(m)};
}
inline Error connection_error(std::string m) {
  return {ErrorCode::kConnection, std::move(m)};
}
inline Error cancelled() {
  return {ErrorCode::kCancelled, "cancelled"};
}

/// A value or an Error; the member names of std::expected, which gcc 12 lacks.
template <class T>
class [[nodiscard]] Result {
 public:
  using value_type = T;
  Result(T value) : v_(std::in_place_index<0>, std::move(value)) {}
  Result(Error error) : v_(std::in_place_index<1>, std::move(error)) {}

  bool has_value() const { return v_.index() == 0; }
  explicit operator bool() const { return has_value(); }
  T& value() & {
    check();
    return std::get<0>(v_);
  }
  const T& value() const& {
    check();
    return std::get<0>(v_);
  }
  T&& value() && {
    check();
    return std::get<0>(std::move(v_));
  }
  T& operator*() & { return value(); }
  const T& operator*() const& { return value(); }
  T&& operator*() && { return std::move(*this).value(); }
  T* operator->() { return &value(); }
  const T* operator->() const { return &value(); }
  const Error& error() const {
    IVIS_ASSERT(!has_value(), "error() of a Result that holds a value");
    return std::get<1>(v_);
  }

 private:
  void check() const { IVIS_ASSERT(has_value(), "value() of a Result that holds an error"); }
  std::variant<T, Error> v_;
};

struct Unit {};
/// Result of something done for its effect.
using Status = Result<Unit>;
inline Status ok() {
  return Unit{};
}

}  // namespace ivis
