// Frames come when they are asked for, once, and go when the budget is used up.
#include "palpate/imaging/frame_store.hpp"

#include "reader_files.hpp"

#include "palpate/core/error.hpp"
#include "palpate/imaging/writer.hpp"
#include "palpate/testing/support.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>
#include <future>
#include <memory>

namespace {

using palpate::core::CancelToken;
using palpate::core::Error;
using palpate::core::ErrorKind;
using palpate::core::Progress;
using palpate::imaging::FrameStore;
using namespace palpate::testing;

constexpr int frames = 12;
constexpr std::size_t frame_voxels = 8 * 6 * 4;
constexpr std::size_t frame_bytes = frame_voxels * sizeof(float);

class Frames : public ::testing::Test {
 protected:
  void SetUp() override { write_frames(frames); }
  void TearDown() override { unsetenv("PALPATE_READER"); }
  /// Every voxel of frame k is k.
  void write_frames(int count) {
    std::string voxels;
    for (int k = 0; k < frames; ++k) voxels += std::string(frame_voxels, static_cast<char>(k));
    voxels.resize(frame_voxels * static_cast<std::size_t>(count));
    write_mha(file_, "8 6 4 12", "MET_UCHAR", voxels, "ElementSpacing = 1 1 1 0.04\n");
  }
  /// A script before the real reader: it counts the readings.
  void count_readings(const std::string& before = {}) {
    write_bytes(folder_ / "counting", "#!/bin/sh\necho >> " + (folder_ / "count").string() + "\n" + before +
                                          "\nexec " + (program_folder() / "palpate-reader").string() +
                                          " \"$@\"\n");
    std::filesystem::permissions(folder_ / "counting", std::filesystem::perms::owner_all);
    setenv("PALPATE_READER", (folder_ / "counting").c_str(), 1);
  }
  std::uintmax_t readings() {
    std::error_code error;
    const auto bytes = std::filesystem::file_size(folder_ / "count", error);
    return error ? 0 : bytes;
  }
  std::string code_of(FrameStore& store, int k) {
    try {
      store.frame(k);
    } catch (const Error& error) {
      return error.code();
    }
    return "none";
  }

  TemporaryFolder folder_;
  std::filesystem::path file_ = folder_ / "beat.mha";
};

TEST_F(Frames, AreReadInBlocksAndKeptWithinTheBudget) {
  count_readings();
  constexpr std::size_t budget = 6 * frame_bytes;
  FrameStore store(file_, {}, budget);
  EXPECT_EQ(store.info().frames, frames);
  ASSERT_EQ(store.info().frame_times_s.size(), static_cast<std::size_t>(frames));
  EXPECT_DOUBLE_EQ(store.info().frame_times_s[3], 0.12);
  EXPECT_EQ(readings(), 1U);
  EXPECT_TRUE(store.holds(0));
  EXPECT_FALSE(store.holds(1));
  for (int k = 0; k < frames; ++k) {
    const auto frame = store.frame(k);
    ASSERT_EQ(frame.size(), frame_voxels);
    EXPECT_EQ(frame.range().min, static_cast<float>(k));
    EXPECT_EQ(frame.range().max, static_cast<float>(k));
    EXPECT_LE(store.held_bytes(), budget);
    EXPECT_TRUE(store.holds(k));
  }
  // Frame 0, then three at a time, half the budget each: 1-3, 4-6, 7-9, 10-11.
  EXPECT_EQ(readings(), 5U);
  EXPECT_FALSE(store.holds(0));
  store.frame(11);
  EXPECT_EQ(readings(), 5U);
}

TEST_F(Frames, TheLongestUnusedGoesFirst) {
  constexpr std::size_t budget = 3 * frame_bytes;  // a block is one frame
  FrameStore store(file_, {}, budget);
  store.frame(4);
  store.frame(8);
  store.frame(0);  // used again
  store.frame(2);
  EXPECT_TRUE(store.holds(0));
  EXPECT_TRUE(store.holds(8));
  EXPECT_TRUE(store.holds(2));
  EXPECT_FALSE(store.holds(4));
}

TEST_F(Frames, OneThatIsHeldOutlivesTheStore) {
  palpate::core::Volume kept;
  {
    FrameStore store(file_, {}, frame_bytes);
    kept = store.frame(3);
    store.frame(7);
    EXPECT_FALSE(store.holds(3));
  }
  EXPECT_EQ(kept.at(7, 5, 3), 3.0F);
}

TEST_F(Frames, ABudgetBelowAFrameStillGivesIt) {
  FrameStore store(file_, {}, 1);
  EXPECT_EQ(store.frame(5).at(0, 0, 0), 5.0F);
  EXPECT_EQ(store.frame(6).at(0, 0, 0), 6.0F);
  EXPECT_EQ(store.held_bytes(), frame_bytes);
}

TEST_F(Frames, TwoAskersCostOneReading) {
  FrameStore store(file_, {}, 100 * frame_bytes);
  count_readings();
  std::vector<std::future<palpate::core::Volume>> asked;
  for (int n = 0; n < 8; ++n)
    asked.push_back(std::async(std::launch::async, [&store, n] { return store.frame(1 + n % 4); }));
  // Whoever comes first reads all that follow, from its own frame on: at most four readings,
  // each frame in one of them only.
  for (int n = 0; n < 8; ++n)
    EXPECT_EQ(asked[static_cast<std::size_t>(n)].get().at(0, 0, 0), static_cast<float>(1 + n % 4));
  EXPECT_LE(readings(), 4U);
  EXPECT_EQ(store.held_bytes() % frame_bytes, 0U);
  EXPECT_LE(store.held_bytes(), static_cast<std::size_t>(frames) * frame_bytes) << "a frame is held twice";
}

TEST_F(Frames, WhoeverStopsWaitingHurtsNobodyElse) {
  FrameStore store(file_, {}, 2 * frame_bytes);
  // The reader waits until the gate is opened.
  const auto gate = folder_ / "gate";
  ASSERT_EQ(std::system(("mkfifo " + gate.string()).c_str()), 0);
  count_readings("echo '{\"progress\":0.1,\"what\":\"waiting\"}' >&4; read -r line < " + gate.string());
  const CancelToken cancel;
  std::promise<void> first_waits;
  std::promise<void> second_waits;
  std::atomic<bool> first_told{false};
  std::atomic<bool> second_told{false};
  auto first = std::async(std::launch::async, [&] {
    try {
      store.frame(5, Progress(
                         [&](double, const std::string&) {
                           if (!first_told.exchange(true)) first_waits.set_value();
                         },
                         cancel));
    } catch (const Error& error) {
      return error.kind();
    }
    return ErrorKind::internal;
  });
  first_waits.get_future().wait();
  auto second = std::async(std::launch::async, [&] {
    return store.frame(5, Progress(
                              [&](double, const std::string&) {
                                if (!second_told.exchange(true)) second_waits.set_value();
                              },
                              {}));
  });
  second_waits.get_future().wait();
  cancel.cancel();
  EXPECT_EQ(first.get(), ErrorKind::cancelled);
  std::ofstream(gate) << "go\n";
  EXPECT_EQ(second.get().at(0, 0, 0), 5.0F);
  EXPECT_EQ(readings(), 1U);
}

TEST_F(Frames, AReadingThatNobodyWaitsForStops) {
  auto store = std::make_unique<FrameStore>(file_, palpate::imaging::ReadOptions{}, 2 * frame_bytes);
  count_readings("echo '{\"progress\":0.1,\"what\":\"waiting\"}' >&4; exec sleep 1000");
  const CancelToken cancel;
  EXPECT_THROW(store->frame(5, Progress([&](double, const std::string&) { cancel.cancel(); }, cancel)),
               Error);
  // Another who asks now gets a reading of his own.
  unsetenv("PALPATE_READER");
  EXPECT_EQ(store->frame(5).at(0, 0, 0), 5.0F);
  store.reset();  // waits for the thread, which must not wait for the sleeper
}

TEST_F(Frames, DamageIsToldAndDoesNotStay) {
  FrameStore store(file_, {}, 2 * frame_bytes);
  EXPECT_EQ(code_of(store, frames), "usage");
  EXPECT_EQ(code_of(store, -1), "usage");
  write_frames(7);
  EXPECT_EQ(code_of(store, 3), "truncated");
  std::filesystem::remove(file_);
  EXPECT_EQ(code_of(store, 3), "not-found");
  write_mha(file_, "8 6 4 2", "MET_UCHAR", std::string(2 * frame_voxels, 'a'));
  EXPECT_NE(code_of(store, 1), "none");
  write_frames(frames);
  EXPECT_EQ(code_of(store, 3), "none");
  EXPECT_TRUE(store.holds(0));
  write_frames(3);
  try {
    FrameStore(file_, {}, 1);
    FAIL() << "it was opened";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), "truncated");
  }
}

TEST_F(Frames, OfEveryKindThatIsWrittenComeOneByOne) {
  std::vector<palpate::core::Volume> beat;
  const palpate::core::ImageGeometry geometry({5, 4, 3}, {0.5, 0.75, 1.0}, {1.0, 2.0, 3.0});
  for (int k = 0; k < 6; ++k) {
    std::vector<float> voxels(geometry.voxel_count(), static_cast<float>(10 * k));
    voxels[7] = 200.0F;
    beat.emplace_back(geometry, voxels);
  }
  for (const std::string ending : {".mha", ".nrrd", ".nii.gz", ".dcm"}) {
    const auto path = folder_ / ("beat" + ending);
    palpate::imaging::write(path, beat, 0.05);
    FrameStore store(path, {}, 4 * geometry.voxel_count() * sizeof(float));
    ASSERT_EQ(store.info().frames, 6) << ending;
    EXPECT_EQ(store.info().geometry.dims(), geometry.dims()) << ending;
    for (const int k : {4, 1, 5, 0, 3, 2}) {
      EXPECT_EQ(store.frame(k).at(0, 0, 0), static_cast<float>(10 * k)) << ending;
      EXPECT_EQ(store.frame(k).data()[7], 200.0F) << ending;
    }
    // Cut off behind the header: refused, now or when the frame is asked for.
    std::filesystem::resize_file(path, std::filesystem::file_size(path) * 6 / 10);
    std::string code = "none";
    try {
      FrameStore cut(path, {}, 1);
      cut.frame(5);
    } catch (const Error& error) {
      code = error.code();
    }
    EXPECT_THAT(code, ::testing::AnyOf("truncated", "bad-header", "unsupported")) << ending;
  }
}

TEST_F(Frames, WhatTheUserStatesHoldsForEachOfThem) {
  palpate::imaging::ReadOptions options;
  options.frame = 4;
  options.spacing_mm = {2.0, 3.0, 4.0};
  FrameStore store(file_, options, 2 * frame_bytes);
  EXPECT_TRUE(store.holds(4));
  EXPECT_FALSE(store.holds(0));
  EXPECT_EQ(store.frame(9).geometry().spacing_mm(), Eigen::Vector3d(2.0, 3.0, 4.0));
}

}  // namespace
