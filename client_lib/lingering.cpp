#include "client_lib/lingering.h"

#include <bit>

namespace ivis::client {

const IdBits& Lingering::draw(const IdBits& pvs, bool fresh) {
  ++frame_;
  bool changed = fresh;
  if (fresh) {
    pvs_.resize(pvs.size());
    Leaving left{frame_ + frames_, IdBits(pvs.size())};
    bool any = false;
    for (std::size_t w = 0; w < pvs.size(); ++w) {
      left.bits[w] = pvs_[w] & ~pvs[w];
      any = any || left.bits[w] != 0;
    }
    if (any) leaving_.push_back(std::move(left));
    pvs_ = pvs;
  }
  while (!leaving_.empty() && leaving_.front().until <= frame_) {
    leaving_.pop_front();
    changed = true;
  }
  if (!changed) return drawn_;
  drawn_ = pvs_;
  for (const Leaving& l : leaving_)
    for (std::size_t w = 0; w < drawn_.size() && w < l.bits.size(); ++w)
      drawn_[w] |= l.bits[w];
  count_ = 0;
  for (const std::uint64_t word : drawn_)
    count_ += static_cast<std::uint32_t>(std::popcount(word));
  return drawn_;
}

}  // namespace ivis::client
