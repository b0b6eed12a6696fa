#pragma once

#include "palpate/session/session_file.hpp"

namespace palpate::gui {

class ViewGrid;
class ViewState;

/// How the views look now, rounded to what an eye can see, so that a session
/// counts as changed only where somebody changed it.
session::Views views_now(const ViewGrid& grid, const ViewState& state);
/// The views of a session, over those of a scan that was just opened.
void show_views(const session::Views& views, ViewGrid& grid, ViewState& state);

}  // namespace palpate::gui
