#include "vtk_support.hpp"

#include <vtkCallbackCommand.h>
#include <vtkCellArray.h>
#include <vtkCommand.h>
#include <vtkFloatArray.h>
#include <vtkLogger.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>

#include <algorithm>
#include <utility>

namespace palpate::surface {

FilterWatch::FilterWatch(vtkAlgorithm* filter, const core::Progress& progress, std::string what)
    : filter_(filter),
      progress_(progress),
      what_(std::move(what)),
      command_(vtkSmartPointer<vtkCallbackCommand>::New()) {
  command_->SetClientData(this);
  command_->SetCallback([](vtkObject* caller, unsigned long, void* self_pointer, void*) {
    auto* self = static_cast<FilterWatch*>(self_pointer);
    auto* running = vtkAlgorithm::SafeDownCast(caller);
    if (running == nullptr) return;
    try {
      self->progress_.report(running->GetProgress(), self->what_);
    } catch (...) {
      running->AbortExecuteOn();
    }
  });
  tag_ = filter_->AddObserver(vtkCommand::ProgressEvent, command_);
}

FilterWatch::~FilterWatch() { filter_->RemoveObserver(tag_); }

namespace {

/// "ERROR: In file.cxx, line 12\nvtkThing (0x..): words\n\n" -> "words".
std::string words_of(const char* message) {
  std::string text = message == nullptr ? "" : message;
  const auto address = text.find("): ");
  if (address != std::string::npos) text.erase(0, address + 3);
  while (!text.empty() && (text.back() == '\n' || text.back() == ' ')) text.pop_back();
  std::replace(text.begin(), text.end(), '\n', ' ');
  return text;
}

}  // namespace

ErrorWatch::ErrorWatch() : command_(vtkSmartPointer<vtkCallbackCommand>::New()) {
  command_->SetClientData(this);
  command_->SetCallback([](vtkObject*, unsigned long event, void* self_pointer, void* data) {
    auto* self = static_cast<ErrorWatch*>(self_pointer);
    if (event != vtkCommand::ErrorEvent && event != vtkCommand::WarningEvent) return;
    if (event == vtkCommand::ErrorEvent) self->failed_ = true;
    constexpr std::size_t longest = 2000;  // a broken file can complain once per value
    if (self->text_.size() > longest) return;
    if (!self->text_.empty()) self->text_ += "; ";
    self->text_ += words_of(static_cast<const char*>(data));
  });
}

namespace {
std::mutex& log_mutex() {
  static std::mutex mutex;
  return mutex;
}
}  // namespace

QuietLog::QuietLog() : lock_(log_mutex()), verbosity_(vtkLogger::GetCurrentVerbosityCutoff()) {
  vtkLogger::SetStderrVerbosity(vtkLogger::VERBOSITY_OFF);
}

QuietLog::~QuietLog() { vtkLogger::SetStderrVerbosity(static_cast<vtkLogger::Verbosity>(verbosity_)); }

vtkSmartPointer<vtkPolyData> to_vtk(const core::TriangleMesh& mesh) {
  auto data = vtkSmartPointer<vtkPolyData>::New();
  const auto count = static_cast<vtkIdType>(mesh.vertices_mm.size());
  vtkNew<vtkFloatArray> coordinates;
  coordinates->SetNumberOfComponents(3);
  coordinates->SetNumberOfTuples(count);
  if (count > 0)
    std::copy_n(mesh.vertices_mm.data()->data(), 3 * mesh.vertices_mm.size(), coordinates->GetPointer(0));
  vtkNew<vtkPoints> points;
  points->SetData(coordinates);
  data->SetPoints(points);
  vtkNew<vtkCellArray> cells;
  cells->AllocateExact(static_cast<vtkIdType>(mesh.triangles.size()),
                       static_cast<vtkIdType>(3 * mesh.triangles.size()));
  for (const auto& triangle : mesh.triangles) cells->InsertNextCell({triangle[0], triangle[1], triangle[2]});
  data->SetPolys(cells);
  if (mesh.normals.size() == mesh.vertices_mm.size() && count > 0) {
    vtkNew<vtkFloatArray> normals;
    normals->SetName("Normals");
    normals->SetNumberOfComponents(3);
    normals->SetNumberOfTuples(count);
    std::copy_n(mesh.normals.data()->data(), 3 * mesh.normals.size(), normals->GetPointer(0));
    data->GetPointData()->SetNormals(normals);
  }
  if (mesh.intensities.size() == mesh.vertices_mm.size() && count > 0) {
    vtkNew<vtkFloatArray> intensities;
    intensities->SetName("intensity");
    intensities->SetNumberOfTuples(count);
    std::copy(mesh.intensities.begin(), mesh.intensities.end(), intensities->GetPointer(0));
    data->GetPointData()->SetScalars(intensities);
  }
  return data;
}

}  // namespace palpate::surface
