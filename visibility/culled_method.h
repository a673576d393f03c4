#pragma once

#include <memory>
#include <utility>
#include <vector>

#include "visibility/method.h"

namespace ivis {

/// Another method's answers less some objects; an answer that lists everything stays whole.
/// Ownership: owns the method. Threads, errors: as the method.
class CulledMethod : public Method {
 public:
  explicit CulledMethod(std::unique_ptr<Method> method) : method_(std::move(method)) {}

  const MethodTraits& traits() const final { return method_->traits(); }
  Backend backend() const final { return method_->backend(); }
  Result<Pvs> solve(const ViewCell& cell) const final { return culled(method_->solve(cell), cell); }
  Result<Pvs> solve(const ViewCell& cell, LastShown& last) const final {
    return culled(method_->solve(cell, last), cell);
  }
  Result<Pvs> solve(const ViewCell& cell, const Effort& effort, Work& done) const final {
    return culled(method_->solve(cell, effort, done), cell);
  }
  bool keeps_to_effort() const final { return method_->keeps_to_effort(); }

 private:
  /// Takes out what need not be listed for the cell.
  virtual void cull(const ViewCell& cell, std::vector<ObjectId>& objects) const = 0;

  Result<Pvs> culled(Result<Pvs> pvs, const ViewCell& cell) const {
    if (pvs && pvs->everything_because.empty()) cull(cell, pvs->objects);
    return pvs;
  }

  std::unique_ptr<Method> method_;
};

}  // namespace ivis
