#pragma once

#include "palpate/core/mesh.hpp"
#include "palpate/core/progress.hpp"

#include <vtkAlgorithm.h>
#include <vtkCallbackCommand.h>
#include <vtkSmartPointer.h>

#include <mutex>
#include <string>

class vtkPolyData;

namespace palpate::surface {

/// Passes a filter's progress on and aborts it once the token is cancelled.
/// Exceptions must not fly through VTK, so check() afterwards.
class FilterWatch {
 public:
  FilterWatch(vtkAlgorithm* filter, const core::Progress& progress, std::string what);
  ~FilterWatch();
  FilterWatch(const FilterWatch&) = delete;
  FilterWatch& operator=(const FilterWatch&) = delete;

 private:
  vtkAlgorithm* filter_;
  core::Progress progress_;
  std::string what_;
  vtkSmartPointer<vtkCallbackCommand> command_;
  unsigned long tag_;
};

/// Collects what a VTK object would have printed.
class ErrorWatch {
 public:
  ErrorWatch();
  vtkCallbackCommand* command() const noexcept { return command_; }
  /// Errors and warnings in the order they came, without VTK's source lines.
  const std::string& text() const noexcept { return text_; }
  bool failed() const noexcept { return failed_; }

 private:
  std::string text_;
  bool failed_ = false;
  vtkSmartPointer<vtkCallbackCommand> command_;
};

/// Keeps VTK's log off the user's screen while it lives: objects inside a
/// reader complain of a broken file where no observer reaches them. VTK has
/// one log, so other threads' complaints of these milliseconds are lost too.
class QuietLog {
 public:
  QuietLog();
  ~QuietLog();
  QuietLog(const QuietLog&) = delete;
  QuietLog& operator=(const QuietLog&) = delete;

 private:
  std::unique_lock<std::mutex> lock_;  ///< two that overlap would restore each other's silence
  int verbosity_;
};

vtkSmartPointer<vtkPolyData> to_vtk(const core::TriangleMesh& mesh);

}  // namespace palpate::surface
