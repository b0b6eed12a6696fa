#pragma once

#include "recent_files.hpp"
#include "scanner_memory.hpp"
#include "views/view_state.hpp"
#include "workbench.hpp"

#include <QMainWindow>
#include <QSettings>

#include <memory>

class QActionGroup;
namespace Ui {
class MainWindow;
}

namespace palpate::gui {

class EmptyState;
class FilterPanel;
class HelpOverlay;
class LostSessionBar;
class SessionKeeper;
struct ScanQuestion;
class JobBar;
class MessageBar;
class SidePanel;
class StatusStrip;
class TimeBar;
class TransportBar;
class ViewGrid;

struct WindowOptions {
  QString settings_file;  ///< INI; the user's own where empty
  QString sample_file;    ///< made anew where it does not exist
  QString device;         ///< selector; empty for the default
};

/// The window. It only wires: what is known stands in the workbench, what is
/// shown in the panels and views.
class MainWindow : public QMainWindow {
  Q_OBJECT

 public:
  explicit MainWindow(const WindowOptions& options, QWidget* parent = nullptr);
  ~MainWindow() override;

  Workbench& workbench() { return workbench_; }
  ViewState& view_state() { return state_; }
  ViewGrid& views() { return *views_; }
  SessionKeeper& session() { return *session_; }
  RecentFiles& recent_files() { return recent_; }
  void open(const QString& path);
  void open_sample();

 protected:
  void closeEvent(QCloseEvent* event) override;
  void dragEnterEvent(QDragEnterEvent* event) override;
  void dragLeaveEvent(QDragLeaveEvent* event) override;
  void dropEvent(QDropEvent* event) override;
  bool eventFilter(QObject* watched, QEvent* event) override;

 private:
  void build_centre();
  void build_side();
  void build_tools();
  void build_file_buttons();
  void build_tool_buttons();
  void build_layout_buttons();
  void wire_files();
  void wire_views();
  void wire_simulation();
  void wire_results();
  void wire_session();
  void restore();
  void choose_file();
  void choose_folder();
  void choose_series(const QString& path, const std::vector<imaging::SeriesSummary>& series);
  void show_data_result();
  void tell_orientation(const QString& orientation);
  void choose_picture();
  void choose_session();
  void save_session();
  void choose_session_file();
  void ask_for_scan(const ScanQuestion& question);
  void show_title();
  void refresh_recent();
  void refresh_actions();
  void toggle_help();
  void show_about();
  void keep_keys_for_views();

  std::unique_ptr<QSettings> settings_;
  WindowOptions options_;
  ScannerMemory scanner_memory_;
  std::unique_ptr<Ui::MainWindow> ui_;
  Workbench workbench_;
  ViewState state_;
  RecentFiles recent_;
  QActionGroup* tools_ = nullptr;
  SidePanel* side_ = nullptr;
  FilterPanel* filter_ = nullptr;
  MessageBar* messages_ = nullptr;
  EmptyState* empty_ = nullptr;
  ViewGrid* views_ = nullptr;
  TransportBar* transport_ = nullptr;
  StatusStrip* status_ = nullptr;
  HelpOverlay* help_ = nullptr;
  LostSessionBar* lost_ = nullptr;
  std::unique_ptr<SessionKeeper> session_;
};

}  // namespace palpate::gui
