#pragma once

#include "palpate/core/progress.hpp"
#include "palpate/model/tissue.hpp"

namespace palpate::model {

/// components_of() that can be stopped.
Components components_with(const LinkGraph& links, std::size_t point_count, const core::CancelToken& cancel);

}  // namespace palpate::model
