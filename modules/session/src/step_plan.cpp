#include "step_plan.hpp"

#include "palpate/core/error.hpp"

#include <cmath>
#include <sstream>

namespace palpate::session {
namespace {
/// Shorter than any step that ends in a lifetime.
constexpr double shortest_s = 1e-9;
}  // namespace

StepPlan plan_step(std::optional<double> named_s, const simulation::StableStep& limit) {
  if (!named_s) return {simulation::automatic_step_s(limit)};
  if (!(*named_s > 0.0) || *named_s > 1.0) core::throw_usage("The step must be above 0 s and at most 1 s.");
  if (*named_s <= limit.step_s) return {*named_s};
  if (limit.step_s < shortest_s) return {*named_s, 1, true};
  const double parts = std::ceil(*named_s / simulation::automatic_step_s(limit));
  return {*named_s / parts, static_cast<int>(parts)};
}

std::string explain(const StepPlan& plan, double named_s, const simulation::StableStep& limit) {
  std::ostringstream text;
  if (plan.has_no_limit)
    text << "No step is surely stable with this scheme and so little damping; the step of " << named_s
         << " s is taken as it is. Give the tissue damping, or choose another integrator, such as rk4.";
  else if (plan.substeps > 1)
    text << "The step of " << named_s << " s is above the largest stable one, " << limit.step_s
         << " s (point " << limit.worst_point << " limits it). Each is taken in " << plan.substeps
         << " parts of " << plan.step_s << " s.";
  return text.str();
}

void StableLimit::set_bound(const simulation::StableStep& at_rest) {
  bound_ = at_rest;
  estimate_.reset();
  stretched_.reset();
}

simulation::StableStep StableLimit::now() const {
  simulation::StableStep known = estimate_ ? *estimate_ : bound_;
  if (!stretched_ || !(stretched_->step_s < bound_.step_s)) return known;
  // Both bounds are as far from the truth as each other.
  known.step_s *= stretched_->step_s / bound_.step_s;
  known.omega_per_s =
      std::max(known.omega_per_s, stretched_->omega_per_s * known.omega_per_s / bound_.omega_per_s);
  known.worst_point = stretched_->worst_point;
  return known;
}

}  // namespace palpate::session
