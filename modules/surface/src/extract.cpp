#include "palpate/surface/extract.hpp"

#include "decimate.hpp"
#include "pieces.hpp"
#include "point_grid.hpp"
#include "vtk_support.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <vtkCellArray.h>
#include <vtkCellArrayIterator.h>
#include <vtkFloatArray.h>
#include <vtkFlyingEdges3D.h>
#include <vtkImageData.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>
#include <vtkWindowedSincPolyDataFilter.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <sstream>
#include <vector>

namespace palpate::surface {
namespace {

using core::Error;
using core::ErrorKind;
using Eigen::Vector3d;

/// Above this the surface is taken from a coarser grid: simplifying millions
/// of faces down to the budget takes longer and keeps no more.
constexpr std::size_t most_faces = 1500000;

/// Voxels with a place: grid point g lies at ijk = first_ijk + step * g.
struct Grid {
  std::array<int, 3> dims{};
  Vector3d first_ijk = Vector3d::Zero();
  double step = 1.0;
  const float* data = nullptr;
  std::vector<float> owned;  ///< what `data` points to, unless it is the volume's own memory

  std::size_t index(int i, int j, int k) const {
    return (static_cast<std::size_t>(k) * static_cast<std::size_t>(dims[1]) + static_cast<std::size_t>(j)) *
               static_cast<std::size_t>(dims[0]) +
           static_cast<std::size_t>(i);
  }
};

[[noreturn]] void throw_no_surface(const std::string& text) {
  throw Error(ErrorKind::input, "no-surface", text);
}

model::CropBox box_of(const core::Volume& volume, const ExtractParameters& parameters) {
  model::CropBox box;
  box.end = volume.dims();
  if (volume.empty() || *std::min_element(box.end.begin(), box.end.end()) < 2)
    throw_no_surface(
        "This image is flat: a surface needs at least two voxels along each axis. Open a volume of "
        "several slices.");
  if (!parameters.crop) return box;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    box.begin[axis] = std::max(0, parameters.crop->begin[axis]);
    box.end[axis] = std::min(volume.dims()[axis], parameters.crop->end[axis]);
    if (box.begin[axis] >= box.end[axis])
      throw_no_surface(
          "The crop box holds no voxel of the volume, so there is nothing to make a surface of.");
  }
  return box;
}

struct BoxContents {
  float low = std::numeric_limits<float>::infinity();
  float high = -std::numeric_limits<float>::infinity();
  bool meets_value = false;     ///< some voxel has exactly the iso value
  bool touches_border = false;  ///< tissue reaches the box's faces
};

BoxContents look_into(const core::Volume& volume, const model::CropBox& box, double iso) {
  BoxContents contents;
  for (int k = box.begin[2]; k < box.end[2]; ++k)
    for (int j = box.begin[1]; j < box.end[1]; ++j) {
      const bool row_on_border =
          k == box.begin[2] || k + 1 == box.end[2] || j == box.begin[1] || j + 1 == box.end[1];
      const float* row = volume.data() + volume.geometry().index(0, j, k);
      for (int i = box.begin[0]; i < box.end[0]; ++i) {
        const double value = row[i];
        contents.low = std::min(contents.low, row[i]);
        contents.high = std::max(contents.high, row[i]);
        contents.meets_value |= value == iso;
        contents.touches_border |=
            value >= iso && (row_on_border || i == box.begin[0] || i + 1 == box.end[0]);
      }
    }
  return contents;
}

/// The box with a layer of voxels around it that closes the surface half a
/// voxel outside the border, where the cells of the border voxels end.
Grid padded(const float* data, const std::array<int, 3>& strides_dims, const model::CropBox& box, double iso,
            double margin) {
  Grid grid;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    grid.dims[axis] = box.end[axis] - box.begin[axis] + 2;
    grid.first_ijk[static_cast<int>(axis)] = box.begin[axis] - 1;
  }
  grid.owned.resize(static_cast<std::size_t>(grid.dims[0]) * static_cast<std::size_t>(grid.dims[1]) *
                    static_cast<std::size_t>(grid.dims[2]));
  const auto source = [&](int i, int j, int k) {
    return data[(static_cast<std::size_t>(k) * static_cast<std::size_t>(strides_dims[1]) +
                 static_cast<std::size_t>(j)) *
                    static_cast<std::size_t>(strides_dims[0]) +
                static_cast<std::size_t>(i)];
  };
  std::size_t next = 0;
  for (int k = 0; k < grid.dims[2]; ++k)
    for (int j = 0; j < grid.dims[1]; ++j)
      for (int i = 0; i < grid.dims[0]; ++i) {
        const int si = std::clamp(box.begin[0] + i - 1, box.begin[0], box.end[0] - 1);
        const int sj = std::clamp(box.begin[1] + j - 1, box.begin[1], box.end[1] - 1);
        const int sk = std::clamp(box.begin[2] + k - 1, box.begin[2], box.end[2] - 1);
        const bool outside = i == 0 || j == 0 || k == 0 || i + 1 == grid.dims[0] || j + 1 == grid.dims[1] ||
                             k + 1 == grid.dims[2];
        const float value = source(si, sj, sk);
        grid.owned[next++] =
            outside && value >= iso ? static_cast<float>(std::min(2.0 * iso - value, iso - margin)) : value;
      }
  grid.data = grid.owned.data();
  return grid;
}

/// Means of blocks of two voxels along each axis.
Grid halved(const Grid& fine) {
  Grid coarse;
  for (std::size_t axis = 0; axis < 3; ++axis) coarse.dims[axis] = std::max(1, fine.dims[axis] / 2);
  coarse.step = 2.0 * fine.step;
  coarse.first_ijk = fine.first_ijk + Vector3d::Constant(0.5 * fine.step);
  coarse.owned.reserve(fine.index(0, 0, fine.dims[2]) / 8);
  for (int k = 0; k < coarse.dims[2]; ++k)
    for (int j = 0; j < coarse.dims[1]; ++j)
      for (int i = 0; i < coarse.dims[0]; ++i) {
        float sum = 0.0F;
        for (int corner = 0; corner < 8; ++corner) {
          const int fi = std::min(2 * i + (corner & 1), fine.dims[0] - 1);
          const int fj = std::min(2 * j + (corner >> 1 & 1), fine.dims[1] - 1);
          const int fk = std::min(2 * k + (corner >> 2), fine.dims[2] - 1);
          sum += fine.data[fine.index(fi, fj, fk)];
        }
        coarse.owned.push_back(sum / 8.0F);
      }
  coarse.data = coarse.owned.data();
  return coarse;
}

/// The grid's isosurface with vertices in ijk.
RawSurface isosurface(const Grid& grid, double iso, const core::Progress& progress) {
  vtkNew<vtkFloatArray> voxels;
  // VTK only reads the voxels, and with save = 1 it does not own them.
  voxels->SetArray(const_cast<float*>(grid.data), static_cast<vtkIdType>(grid.index(0, 0, grid.dims[2])), 1);
  vtkNew<vtkImageData> image;
  image->SetDimensions(grid.dims.data());
  image->GetPointData()->SetScalars(voxels);
  vtkNew<vtkFlyingEdges3D> edges;
  edges->SetInputData(image);
  edges->SetValue(0, iso);
  edges->ComputeNormalsOff();
  edges->ComputeGradientsOff();
  edges->ComputeScalarsOff();
  {
    const FilterWatch watch(edges, progress, "Finding the surface");
    edges->Update();
  }
  progress.cancel().check();
  vtkPolyData* output = edges->GetOutput();
  RawSurface surface;
  surface.vertices.resize(static_cast<std::size_t>(output->GetNumberOfPoints()));
  for (std::size_t vertex = 0; vertex < surface.vertices.size(); ++vertex) {
    output->GetPoint(static_cast<vtkIdType>(vertex), surface.vertices[vertex].data());
    surface.vertices[vertex] = grid.first_ijk + grid.step * surface.vertices[vertex];
  }
  surface.triangles.reserve(static_cast<std::size_t>(output->GetNumberOfPolys()));
  vtkSmartPointer<vtkCellArrayIterator> cell;
  cell.TakeReference(output->GetPolys()->NewIterator());
  for (cell->GoToFirstCell(); !cell->IsDoneWithTraversal(); cell->GoToNextCell()) {
    vtkIdType count = 0;
    const vtkIdType* ids = nullptr;
    cell->GetCurrentCell(count, ids);
    if (count == 3)
      surface.triangles.push_back({static_cast<std::uint32_t>(ids[0]), static_cast<std::uint32_t>(ids[1]),
                                   static_cast<std::uint32_t>(ids[2])});
  }
  return surface;
}

void smooth(RawSurface& surface, int passes, const core::Progress& progress) {
  if (passes == 0) return;
  vtkNew<vtkPoints> points;
  points->SetDataTypeToDouble();
  points->SetNumberOfPoints(static_cast<vtkIdType>(surface.vertices.size()));
  for (std::size_t vertex = 0; vertex < surface.vertices.size(); ++vertex)
    points->SetPoint(static_cast<vtkIdType>(vertex), surface.vertices[vertex].data());
  vtkNew<vtkCellArray> cells;
  cells->AllocateExact(static_cast<vtkIdType>(surface.triangles.size()),
                       static_cast<vtkIdType>(3 * surface.triangles.size()));
  for (const auto& triangle : surface.triangles)
    cells->InsertNextCell({triangle[0], triangle[1], triangle[2]});
  vtkNew<vtkPolyData> data;
  data->SetPoints(points);
  data->SetPolys(cells);
  vtkNew<vtkWindowedSincPolyDataFilter> sinc;
  sinc->SetInputData(data);
  sinc->SetNumberOfIterations(passes);
  sinc->SetPassBand(0.1);  // takes the staircase of the voxels away and leaves what is a few voxels wide
  sinc->NormalizeCoordinatesOn();
  sinc->FeatureEdgeSmoothingOff();
  sinc->BoundarySmoothingOff();
  sinc->NonManifoldSmoothingOn();
  {
    const FilterWatch watch(sinc, progress, "Smoothing the surface");
    sinc->Update();
  }
  progress.cancel().check();
  vtkPolyData* output = sinc->GetOutput();
  for (std::size_t vertex = 0; vertex < surface.vertices.size(); ++vertex) {
    Vector3d moved;
    output->GetPoint(static_cast<vtkIdType>(vertex), moved.data());
    if (moved.allFinite()) surface.vertices[vertex] = moved;
  }
}

/// Vertices in mm around the volume's centre in, LPS with normals and intensities out.
core::TriangleMesh finished(const RawSurface& surface, const core::Volume& volume) {
  const Vector3d center_mm = volume.geometry().center_mm();
  core::TriangleMesh mesh;
  mesh.triangles = surface.triangles;
  mesh.vertices_mm.reserve(surface.vertices.size());
  for (const auto& vertex : surface.vertices)
    mesh.vertices_mm.emplace_back((center_mm + vertex).cast<float>());
  mesh.normals = core::vertex_normals(mesh);
  // On the surface itself every value is the iso value; the colour comes from just inside.
  const double depth_mm = 0.75 * volume.geometry().spacing_mm().minCoeff();
  mesh.intensities.reserve(surface.vertices.size());
  for (std::size_t vertex = 0; vertex < surface.vertices.size(); ++vertex) {
    const Vector3d inside =
        center_mm + surface.vertices[vertex] - depth_mm * mesh.normals[vertex].cast<double>();
    mesh.intensities.push_back(volume.sample(volume.geometry().to_ijk(inside)));
  }
  return mesh;
}

bool can_be_halved(const Grid& grid) { return *std::min_element(grid.dims.begin(), grid.dims.end()) >= 8; }

Grid closed(const Grid& grid, double iso, double margin) {
  model::CropBox whole;
  whole.end = grid.dims;
  Grid padded_grid = padded(grid.data, grid.dims, whole, iso, margin);
  padded_grid.first_ijk = grid.first_ijk - Vector3d::Constant(grid.step);
  padded_grid.step = grid.step;
  return padded_grid;
}

/// The grid's surface in mm around the volume's centre, wound outwards, smooth,
/// and as close to the budget as it gets; nothing where it has so many faces
/// that a coarser grid is the better way.
std::optional<RawSurface> made_from(const Grid& grid, const core::ImageGeometry& geometry,
                                    const ExtractParameters& parameters, double iso,
                                    const core::Progress& progress) {
  RawSurface surface = isosurface(grid, iso, progress.part(0.0, 0.2));
  const auto budget = static_cast<std::size_t>(parameters.face_budget);
  if (surface.triangles.size() > std::max(most_faces, budget) && can_be_halved(grid)) return std::nullopt;
  drop_specks(surface, parameters.min_component > 1 ? static_cast<double>(parameters.min_component) : 0.0);
  // Once in millimetres, smoothing and simplifying see the true proportions.
  const Vector3d center_mm = geometry.center_mm();
  for (auto& vertex : surface.vertices) vertex = geometry.to_lps_mm(vertex) - center_mm;
  if (geometry.ijk_to_lps_mm().topLeftCorner<3, 3>().determinant() < 0.0)
    for (auto& triangle : surface.triangles)
      std::swap(triangle[1], triangle[2]);  // a mirror turns faces over
  smooth(surface, parameters.smoothing_passes, progress.part(0.2, 0.5));
  return decimate(std::move(surface), budget, progress.part(0.5, 1.0));
}

void check(const ExtractParameters& parameters) {
  if (!std::isfinite(parameters.iso_value)) core::throw_usage("The surface's value is not a finite number.");
  if (parameters.face_budget < 4) core::throw_usage("A surface needs a budget of at least 4 faces.");
  if (parameters.smoothing_passes < 0)
    core::throw_usage("The number of smoothing passes cannot be negative.");
}

}  // namespace

core::TriangleMesh extract(const core::Volume& volume, const ExtractParameters& parameters,
                           const core::Progress& progress) {
  check(parameters);
  progress.report(0.0, "Finding the surface");
  const model::CropBox box = box_of(volume, parameters);
  double iso = parameters.iso_value;
  const BoxContents contents = look_into(volume, box, iso);
  if (!(contents.high >= iso)) {
    std::ostringstream text;
    text << "No voxel reaches the value " << iso << ": the voxels go from " << contents.low << " to "
         << contents.high << ". Choose a lower threshold.";
    throw_no_surface(text.str());
  }
  // A voxel of exactly the iso value would collapse the faces around it into a
  // point; a ten-thousandth of the range moves the surface by as much of a voxel.
  const double margin = std::max(1e-4 * (static_cast<double>(contents.high) - contents.low),
                                 1e-6 * std::max(1.0, std::abs(iso)));
  if (contents.meets_value) iso -= margin;

  Grid grid;
  if (contents.touches_border || parameters.crop) {
    grid = padded(volume.data(), volume.dims(), box, iso, margin);
  } else {
    grid.dims = volume.dims();
    grid.data = volume.data();
  }
  const auto budget = static_cast<std::size_t>(parameters.face_budget);
  auto surface = made_from(grid, volume.geometry(), parameters, iso, progress.part(0.0, 0.95));
  // Too many faces, or too many handles to come down to the budget: from half the voxels along each axis.
  while ((!surface || surface->triangles.size() > budget) && can_be_halved(grid)) {
    grid = halved(grid);
    auto coarser =
        made_from(closed(grid, iso, margin), volume.geometry(), parameters, iso, progress.part(0.2, 0.95));
    if (coarser && coarser->triangles.empty()) break;  // what there is is finer than this grid
    surface = std::move(coarser);
  }
  if (!surface || surface->triangles.empty())
    throw_no_surface("The surface at this value is finer than its faces can show. Filter the volume first.");
  drop_smallest_pieces(*surface, budget);
  core::TriangleMesh mesh = finished(*surface, volume);
  progress.report(1.0, "Surface ready");
  return mesh;
}

core::TriangleMesh keep_near(const core::TriangleMesh& mesh, const model::PointCloud& points,
                             double reach_mm) {
  const PointGrid grid(points.positions_mm);
  std::vector<bool> near(mesh.vertices_mm.size());
  for (std::size_t vertex = 0; vertex < near.size(); ++vertex)
    near[vertex] = grid.any_within(mesh.vertices_mm[vertex].cast<double>() - points.center_mm, reach_mm);
  constexpr std::uint32_t gone = std::numeric_limits<std::uint32_t>::max();
  std::vector<std::uint32_t> renumbered(near.size(), gone);
  core::TriangleMesh kept;
  const bool with_normals = mesh.normals.size() == near.size();
  const bool with_intensities = mesh.intensities.size() == near.size();
  for (auto triangle : mesh.triangles) {
    if (!near[triangle[0]] || !near[triangle[1]] || !near[triangle[2]]) continue;
    for (auto& vertex : triangle) {
      if (renumbered[vertex] == gone) {
        renumbered[vertex] = static_cast<std::uint32_t>(kept.vertices_mm.size());
        kept.vertices_mm.push_back(mesh.vertices_mm[vertex]);
        if (with_normals) kept.normals.push_back(mesh.normals[vertex]);
        if (with_intensities) kept.intensities.push_back(mesh.intensities[vertex]);
      }
      vertex = renumbered[vertex];
    }
    kept.triangles.push_back(triangle);
  }
  return kept;
}

}  // namespace palpate::surface
