#include "palpate/core/error.hpp"
#include "palpate/visualization/picture.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

using namespace palpate;
using namespace palpate::visualization;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;

namespace {

SceneContent content() {
  SceneContent content;
  content.volume = {core::ImageGeometry({40, 50, 60}, {0.5, 0.75, 1.25}, {-10, -20, -30}),
                    std::vector<float>(40 * 50 * 60, 1.0F)};
  content.spacing_badge = "stated";
  content.orientation_known = true;
  return content;
}

std::vector<std::string> texts_of(const SceneContent& content, PictureView view = PictureView::axial) {
  ViewSettings settings = standard_settings(content.volume);
  settings.window = 200.0;
  settings.level = 90.0;
  settings.crosshair_mm = content.volume.geometry().to_lps_mm({3, 4, 12});
  return burned_in_text(content, settings, {800, 600, view});
}

}  // namespace

TEST(BurnedInText, NamesPlacePositionWindowAndSpacing) {
  const auto texts = texts_of(content());
  EXPECT_THAT(texts, Contains("Axial"));
  EXPECT_THAT(texts, Contains("I 15.0 mm · slice 13 of 60"));  // -30 + 12 * 1.25 = -15: below zero is I
  EXPECT_THAT(texts, Contains("W 200  L 90"));
  EXPECT_THAT(texts, Contains("0.5 × 0.75 × 1.25 mm · stated"));
  EXPECT_THAT(texts, Contains("100 %"));
  for (const char* side : {"R", "L", "A", "P"}) EXPECT_THAT(texts, Contains(side));
  EXPECT_THAT(texts, Contains(HasSubstr(" mm")));
}

TEST(BurnedInText, HasNoLettersWhereTheOrientationIsUnknown) {
  SceneContent unknown = content();
  unknown.orientation_known = false;
  const auto texts = texts_of(unknown, PictureView::four_up);
  for (const char* side : {"R", "L", "A", "P", "S", "I"}) EXPECT_THAT(texts, Not(Contains(side)));
  EXPECT_THAT(texts, Contains("i"));  // the gizmo shows the image's axes instead
}

TEST(BurnedInText, SpeaksOfVoxelsWhileTheSpacingIsAssumed) {
  SceneContent assumed = content();
  assumed.spacing_assumed = true;
  assumed.spacing_badge = "assumed";
  const auto texts = texts_of(assumed, PictureView::four_up);
  for (const std::string& text : texts) EXPECT_THAT(text, Not(HasSubstr("mm")));
  EXPECT_THAT(texts, Contains(HasSubstr("voxels")));
  EXPECT_THAT(texts, Contains(HasSubstr("assumed")));
}

TEST(BurnedInText, IsNothingWithoutAnnotations) {
  ViewSettings settings = standard_settings(content().volume);
  settings.annotations = false;
  EXPECT_TRUE(burned_in_text(content(), settings, {800, 600, PictureView::four_up}).empty());
}

TEST(PictureRequest, SizesAndViewsOutOfRangeAreRefused) {
  for (const auto& [width, height] : {std::pair{15, 600}, {800, 8193}, {0, 0}, {-5, 600}}) {
    try {
      draw_picture(content(), {}, {width, height, PictureView::axial});
      FAIL() << width << "x" << height;
    } catch (const core::Error& error) {
      EXPECT_EQ(error.kind(), core::ErrorKind::usage);
    }
  }
  EXPECT_EQ(picture_view_from("side-by-side"), PictureView::side_by_side);
  EXPECT_EQ(picture_view_from("3d"), PictureView::three_d);
  EXPECT_THROW(picture_view_from("oblique"), core::Error);
}
