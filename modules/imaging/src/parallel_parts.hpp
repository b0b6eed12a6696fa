#pragma once

#include "palpate/core/progress.hpp"
#include "palpate/core/volume.hpp"

#include <functional>
#include <string>

namespace palpate::imaging {

/// Calls work(0) .. work(count - 1), each once and in no order, on all cores.
/// Reports and cancels between two of them, on the thread that called; so one
/// should take far less than a second. Throws what `work` or the report threw.
void for_each_part(int count, const core::Progress& progress, const std::string& what,
                   const std::function<void(int)>& work);

/// The same over the rows of a volume, work(j, k).
void for_each_row(const core::ImageGeometry& geometry, const core::Progress& progress,
                  const std::string& what, const std::function<void(int j, int k)>& work);

}  // namespace palpate::imaging
