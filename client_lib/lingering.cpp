#include "client_lib/lingering.h"

#include <bit>

namespace ivis::client {

const IdBits& Lingering::draw(const IdBits& pvs, bool fresh) {
  ++frame_;
  if (fresh) {
    pvs_.resize(pvs.size());
    drawn_.resize(pvs.size());
    until_.resize(pvs.size() * 64);
    for (std::size_t w = 0; w < pvs.size(); ++w) {
      for (std::uint64_t left = pvs_[w] & ~pvs[w]; left != 0; left &= left - 1) {
        const std::size_t id = w * 64 + static_cast<std::size_t>(std::countr_zero(left));
        until_[id] = frame_ + frames_;
        leaving_.emplace_back(until_[id], static_cast<ObjectId>(id));
      }
      for (std::uint64_t back = pvs[w] & ~pvs_[w] & drawn_[w]; back != 0; back &= back - 1)
        until_[w * 64 + static_cast<std::size_t>(std::countr_zero(back))] = 0;
      count_ += static_cast<std::uint32_t>(std::popcount(pvs[w] & ~drawn_[w]));
      drawn_[w] |= pvs[w];
    }
    pvs_ = pvs;
  }
  while (!leaving_.empty() && leaving_.front().first <= frame_) {
    const auto [until, id] = leaving_.front();
    leaving_.pop_front();
    if (until_[id] != until) continue;  // it came back meanwhile
    until_[id] = 0;
    drawn_[id >> 6U] &= ~(std::uint64_t{1} << (id & 63U));
    --count_;
  }
  return drawn_;
}

}  // namespace ivis::client
