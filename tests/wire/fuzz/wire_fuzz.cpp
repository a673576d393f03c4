// libFuzzer target over the two decoders, built on request only (IVIS_BUILD_FUZZ, clang). The first
// byte picks the decoder and the base. What a decoder takes must be what an encoder writes.

#include <cstdint>
#include <cstring>
#include <vector>

#include "core/assert.h"
#include "wire/messages.h"
#include "wire/pvs_codec.h"

namespace {

using namespace ivis::wire;

void fuzz_message(std::span<const std::byte> input) {
  std::vector<std::byte> bytes(input.begin(), input.end());
  if (bytes.size() >= 4) {
    // The right prefix, so that it is not all there is to guess.
    const auto prefix = static_cast<std::uint32_t>(bytes.size() - 4);
    std::memcpy(bytes.data(), &prefix, sizeof prefix);
  }
  const auto message = decode(bytes);
  if (!message) return;
  const auto again = decode(encode(*message));
  IVIS_ASSERT(again && *again == *message, "a message that was taken can be sent on");
}

void fuzz_payload(std::uint32_t objects, std::span<const std::byte> bytes) {
  PvsState base(objects);
  for (ivis::Rank r = 0; r < objects; ++r)
    if (r * 0x9e3779b9U >> 30U == 0) base.set.set(r);
  const auto decoded = decode_pvs(bytes, base);
  if (!decoded) return;
  PvsState after;
  const auto written = encode_pvs(decoded->set, base, after);
  IVIS_ASSERT(std::vector<std::byte>(bytes.begin(), bytes.end()) == written && after == *decoded,
              "a set has one payload against a base");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::span rest(reinterpret_cast<const std::byte*>(data + 1), size - 1);
  if (data[0] < 128)
    fuzz_message(rest);
  else
    fuzz_payload((data[0] - 128U) * 37U, rest);
  return 0;
}
