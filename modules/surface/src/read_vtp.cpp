#include "mesh_source.hpp"
#include "vtk_support.hpp"

#include "palpate/core/error.hpp"

#include <vtkCellArray.h>
#include <vtkCommand.h>
#include <vtkDataArray.h>
#include <vtkExecutive.h>
#include <vtkFieldData.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>
#include <vtkStringArray.h>
#include <vtkXMLPolyDataReader.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <exception>
#include <limits>

namespace palpate::surface {
namespace {

/// Counts are checked before VTK takes memory for them: even packed a
/// thousandfold, each point or cell is some part of a byte.
void check_counts(const MeshSource& source) {
  constexpr std::string_view key = "NumberOf";
  constexpr std::size_t most_a_byte = 1100;
  for (auto at = source.bytes.find(key); at != std::string_view::npos; at = source.bytes.find(key, at + 1)) {
    const auto quote = source.bytes.find_first_of("\"'", at);
    constexpr std::size_t longest_name = 40;
    if (quote == std::string_view::npos || quote > at + longest_name) continue;
    const auto end = source.bytes.find_first_of("\"'", quote + 1);
    if (end == std::string_view::npos) continue;
    TextCursor word(source.bytes.substr(quote + 1, end - quote - 1));
    const auto count = integer_in(word.word());
    if (!count || *count < 0 || static_cast<std::uint64_t>(*count) / most_a_byte > source.bytes.size())
      source.damaged("it announces more points or polygons than the file can hold");
  }
}

/// VTK 9.1 crashes where an array of the field data has no type that it knows.
void check_array_types(const MeshSource& source) {
  constexpr std::array<std::string_view, 12> known{"Int8",    "UInt8",   "Int16",  "UInt16",
                                                   "Int32",   "UInt32",  "Int64",  "UInt64",
                                                   "Float32", "Float64", "String", "Bit"};
  constexpr std::string_view key = "type";
  constexpr std::string_view blanks = " \t\r\n";
  const std::string_view text = source.bytes.substr(0, source.bytes.find("<AppendedData"));
  for (auto at = text.find("Array"); at != std::string_view::npos; at = text.find("Array", at + 1)) {
    const auto begin = text.find_last_of('<', at);
    if (begin == std::string_view::npos || text.find_first_of(" \t\r\n>/", begin + 1) < at) continue;
    const std::string_view element = text.substr(begin, text.find('>', at) - begin);
    bool is_known = false;
    for (auto word = element.find(key); word != std::string_view::npos; word = element.find(key, word + 1)) {
      const auto value = element.find_first_not_of(blanks, word + key.size());
      if (word == 0 || blanks.find(element[word - 1]) == std::string_view::npos) continue;
      if (value == std::string_view::npos || element[value] != '=') continue;
      const auto quote = element.find_first_of("\"'", value);
      if (quote == std::string_view::npos) continue;
      const auto end = element.find(element[quote], quote + 1);
      const auto name = element.substr(quote + 1, end == std::string_view::npos ? 0 : end - quote - 1);
      is_known = is_known || std::find(known.begin(), known.end(), name) != known.end();
    }
    if (!is_known) source.damaged("it holds an array without a type that is known");
  }
}

/// Without it VTK reads the sizes of packed blocks as half as wide as they are, and believes them.
void check_header_type(const MeshSource& source) {
  const std::string_view text = source.bytes.substr(source.bytes.find("<VTKFile"));
  const std::string_view root = text.substr(0, text.find('>'));
  const auto holds = [&](const std::string& attribute, const std::string& value) {
    return root.find(attribute + "=\"" + value) != std::string_view::npos ||
           root.find(attribute + "='" + value) != std::string_view::npos;
  };
  const bool is_old = holds("version", "0.");
  const bool has_width = holds("header_type", "UInt64") || holds("header_type", "UInt32");
  if (root.find("compressor") != std::string_view::npos && !is_old && !has_width)
    source.damaged("it does not say how wide the sizes of its packed blocks are");
}

/// Cells as lists of points, checked: VTK trusts what the file says of them.
std::vector<std::vector<std::int64_t>> cells_of(vtkCellArray* cells, const MeshSource& source) {
  std::vector<std::vector<std::int64_t>> lists;
  if (cells == nullptr) return lists;
  vtkDataArray* offsets = cells->GetOffsetsArray();
  vtkDataArray* points = cells->GetConnectivityArray();
  if (offsets == nullptr || points == nullptr) return lists;
  const auto value = [](vtkDataArray* array, vtkIdType n) {
    return static_cast<std::int64_t>(array->GetComponent(n, 0));
  };
  for (vtkIdType n = 0; n + 1 < offsets->GetNumberOfValues(); ++n) {
    const std::int64_t begin = value(offsets, n);
    const std::int64_t end = value(offsets, n + 1);
    if (begin < 0 || end < begin || end > points->GetNumberOfValues())
      source.damaged("the list of its polygons is out of order");
    std::vector<std::int64_t> list;
    for (std::int64_t at = begin; at < end; ++at) list.push_back(value(points, at));
    lists.push_back(std::move(list));
  }
  return lists;
}

void collect(vtkPolyData* data, const MeshSource& source, MeshContents& contents) {
  const vtkIdType count = data->GetPoints() == nullptr ? 0 : data->GetNumberOfPoints();
  if (count > static_cast<vtkIdType>(std::numeric_limits<std::uint32_t>::max()))
    source.unsupported("it has too many points");
  for (vtkIdType point = 0; point < count; ++point) {
    std::array<double, 3> place{};
    data->GetPoints()->GetPoint(point, place.data());
    contents.vertices.emplace_back(static_cast<float>(place[0]), static_cast<float>(place[1]),
                                   static_cast<float>(place[2]));
  }
  const auto refuse = [&] { source.damaged("a polygon names a point that is not there"); };
  for (const auto& polygon : cells_of(data->GetPolys(), source))
    if (!add_polygon(polygon, contents.vertices.size(), contents)) refuse();
  for (const auto& strip : cells_of(data->GetStrips(), source))
    for (std::size_t n = 2; n < strip.size(); ++n) {
      const bool turned = n % 2 == 1;
      if (!add_polygon({strip[n - 2], strip[turned ? n : n - 1], strip[turned ? n - 1 : n]},
                       contents.vertices.size(), contents))
        refuse();
    }
  vtkDataArray* intensities = data->GetPointData()->GetArray("intensity");
  if (intensities != nullptr && intensities->GetNumberOfComponents() == 1 &&
      intensities->GetNumberOfTuples() == count)
    for (vtkIdType point = 0; point < count; ++point)
      contents.intensities.push_back(static_cast<float>(intensities->GetComponent(point, 0)));
  const auto* space = vtkStringArray::SafeDownCast(data->GetFieldData()->GetAbstractArray("SPACE"));
  if (space != nullptr && const_cast<vtkStringArray*>(space)->GetNumberOfValues() > 0)
    contents.stated_space = stated_space_in("SPACE=" + const_cast<vtkStringArray*>(space)->GetValue(0));
  if (contents.triangles.empty() && data->GetNumberOfLines() + data->GetNumberOfVerts() > 0)
    source.no_polygons(contents.vertices.size(), "it holds only points and lines");
}

}  // namespace

MeshContents read_vtp(const MeshSource& source) {
  constexpr std::size_t looked_at = 4096;
  const std::string_view beginning = source.bytes.substr(0, looked_at);
  if (beginning.find("<VTKFile") == std::string_view::npos)
    source.damaged("it does not begin as a VTK XML file");
  if (beginning.find("\"PolyData\"") == std::string_view::npos &&
      beginning.find("'PolyData'") == std::string_view::npos)
    source.unsupported("it is a VTK XML file of another kind than PolyData");
  const std::string_view end =
      source.bytes.substr(source.bytes.size() - std::min<std::size_t>(64, source.bytes.size()));
  if (end.find("</VTKFile>") == std::string_view::npos) source.damaged("it ends before </VTKFile>");
  check_counts(source);
  check_array_types(source);
  check_header_type(source);
  MeshContents contents;
  contents.stated_space = stated_space_in(beginning.substr(0, beginning.find("<PolyData")));
  ErrorWatch errors;
  const QuietLog quiet;
  try {
    vtkNew<vtkXMLPolyDataReader> reader;
    reader->AddObserver(vtkCommand::ErrorEvent, errors.command());
    reader->AddObserver(vtkCommand::WarningEvent, errors.command());
    // The pipeline says again, and on its own account, that the reader failed.
    reader->GetExecutive()->AddObserver(vtkCommand::ErrorEvent, errors.command());
    reader->SetReaderErrorObserver(errors.command());
    reader->SetParserErrorObserver(errors.command());
    reader->ReadFromInputStringOn();
    reader->SetInputString(std::string(source.bytes));
    reader->Update();
    if (!errors.failed() && reader->GetErrorCode() == 0) collect(reader->GetOutput(), source, contents);
    if (errors.failed() || reader->GetErrorCode() != 0)
      source.damaged(errors.text().empty() ? "VTK cannot read it" : errors.text());
  } catch (const core::Error&) {
    throw;
  } catch (const std::exception&) {
    source.damaged("it asks for more memory than there is");
  }
  return contents;
}

}  // namespace palpate::surface
