#pragma once

#include "workbench.hpp"

#include <QFrame>

#include <functional>
#include <memory>

class QPushButton;

namespace Ui {
class MessageBar;
}

namespace palpate::gui {

/// One sentence above the views, with details for who wants them.
class MessageBar : public QFrame {
  Q_OBJECT

 public:
  explicit MessageBar(QWidget* parent = nullptr);
  ~MessageBar() override;
  void show_problem(const Problem& problem);
  void show_info(const QString& text);
  /// With one thing to do about it.
  void show_info(const QString& text, const QString& action, std::function<void()> act);

 signals:
  void referenceRequested();
  void deviceRequested(const QString& selector);

 private:
  void show_kind(const char* kind, const char* icon_name, const QColor& color, const QString& text);
  void copy() const;

  std::unique_ptr<Ui::MessageBar> ui_;
  QPushButton* action_;
  std::function<void()> act_;
  Problem problem_;
};

}  // namespace palpate::gui
