#pragma once

#include "palpate/simulation/stability.hpp"

#include <optional>
#include <string>

namespace palpate::session {

/// The step that is taken for the one that was asked for.
struct StepPlan {
  double step_s = 0.0;
  int substeps = 1;           ///< steps taken for one that was named
  bool has_no_limit = false;  ///< no step is stable (explicit Euler without damping): taken as named
};
/// A named step above the largest stable one is taken in as many parts as keep
/// each at the automatic step or below. Throws Error(usage) for a named step
/// that is not above 0 s and at most 1 s, and as automatic_step_s() does.
StepPlan plan_step(std::optional<double> named_s, const simulation::StableStep& limit);
/// For people, where a plan differs from what was named; empty otherwise.
std::string explain(const StepPlan& plan, double named_s, const simulation::StableStep& limit);

/// The largest stable step as it is known now: the bound of the tissue at rest
/// at once, the estimate once it came, and both shortened as stretching stiffens.
class StableLimit {
 public:
  /// Of the tissue at rest. Forgets what was known besides.
  void set_bound(const simulation::StableStep& at_rest);
  void set_estimate(const simulation::StableStep& at_rest) { estimate_ = at_rest; }
  /// The bound at the present places.
  void set_stretched(const simulation::StableStep& bound_now) { stretched_ = bound_now; }
  bool has_estimate() const noexcept { return estimate_.has_value(); }
  simulation::StableStep now() const;

 private:
  simulation::StableStep bound_;
  std::optional<simulation::StableStep> estimate_;
  std::optional<simulation::StableStep> stretched_;
};

}  // namespace palpate::session
