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
  Result<Pvs> solve(const ViewCell& cell) const final {
    return culled(method_->solve(cell), cell, nullptr);
  }
  Result<Pvs> solve(const ViewCell& cell, LastShown& last) const final {
    return culled(method_->solve(cell, last), cell, nullptr);
  }
  Result<Pvs> solve(const ViewCell& cell, const Effort& effort, Work& done) const final {
    return culled(method_->solve(cell, effort, done), cell, nullptr);
  }
  Result<Pvs> solve(const ViewCell& cell, const Effort& effort, const Amendment& amendment,
                    Work& done) const final {
    return culled(method_->solve(cell, effort, amendment, done), cell, &amendment);
  }
  bool takes_amendments() const final { return method_->takes_amendments(); }
  bool keeps_to_effort() const final { return method_->keeps_to_effort(); }

 private:
  /// Takes out what need not be listed for the cell. `amendment`: null, the scene is as it was.
  virtual void cull(const ViewCell& cell, const Amendment* amendment,
                    std::vector<ObjectId>& objects) const = 0;

  Result<Pvs> culled(Result<Pvs> pvs, const ViewCell& cell, const Amendment* amendment) const {
    if (pvs && pvs->everything_because.empty()) cull(cell, amendment, pvs->objects);
    return pvs;
  }

  std::unique_ptr<Method> method_;
};

}  // namespace ivis
