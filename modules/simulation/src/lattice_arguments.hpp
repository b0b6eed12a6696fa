#pragma once

namespace palpate::simulation {

/// The sweep's arguments, by their place.
enum Argument : unsigned {
  source_argument,
  base_argument,
  second_argument,
  third_argument,
  target_argument,
  waiting_argument,
  rest_argument,
  rows_argument,
  entries_argument,
  chunks_argument,
  overflow_begins_argument,
  overflow_argument,
  freedom_argument,
  factors_argument,
  first_chunk_argument,
  chunk_count_argument,
  first_trash_argument,
  all_free_argument,
  mode_argument,
  h_argument,
  stiffness_argument,
  rest_scale_argument,
  rest_offset_argument,
  damping_argument,
  length_scale_argument,
  drag_argument,
  gravity_argument,
  over_mass_argument,
  step_x_argument
};

}  // namespace palpate::simulation
