// What entries would open as, told by children that look at headers.
#include "info_json.hpp"
#include "parsed.hpp"
#include "process.hpp"
#include "series.hpp"
#include "small_picture.hpp"

#include <algorithm>
#include <stdexcept>

namespace palpate::imaging::reading {
namespace {

core::Picture picture_of(const nlohmann::json& item) {
  core::Picture picture;
  picture.width_px = item.at("width").get<int>();
  picture.height_px = item.at("height").get<int>();
  const auto grey = bytes_of_hex(item.at("grey").get<std::string>());
  const auto fits = [](int side) { return side >= 1 && side <= SmallPicture::most_px; };
  if (!fits(picture.width_px) || !fits(picture.height_px) || !grey ||
      grey->size() !=
          static_cast<std::size_t>(picture.width_px) * static_cast<std::size_t>(picture.height_px))
    throw std::invalid_argument("a picture of another size than it says");
  constexpr std::uint8_t opaque = 255;
  for (const auto value : *grey) picture.rgba.insert(picture.rgba.end(), {value, value, value, opaque});
  return picture;
}

/// Whether the whole would fail like its one picture did.
bool is_final(const core::Error& error) {
  return error.code() != "too-large" && error.code() != "reader-memory";
}

core::VolumeInfo checked_info(const nlohmann::json& volume) {
  try {
    return info_from_json(volume);
  } catch (const core::Error& error) {
    throw std::invalid_argument(error.what());
  }
}

/// What children said of the entries so far.
class Told {
 public:
  Told(const std::vector<Entry>& entries, bool pictures)
      : entries_(entries), pictures_(pictures), all_(entries.size()) {}

  void take(const nlohmann::json& item) {
    if (item.contains("volume") || item.contains("error")) {
      if (next_ == end_) throw std::invalid_argument("more than was asked for");
      const std::size_t place = next_++;
      if (item.contains("error"))
        all_[place].error = error_of(item.at("error"), entries_[place].shown);
      else
        all_[place].info = checked_info(item.at("volume"));
      picture_due_ = pictures_ && all_[place].info.has_value();
      return;
    }
    if (!picture_due_) throw std::invalid_argument("a picture of nothing");
    picture_due_ = false;
    Description& last = all_[next_ - 1];
    if (item.contains("picture_error")) {
      const core::Error error = error_of(item.at("picture_error"), entries_[next_ - 1].shown);
      if (is_final(error)) last.error = error;
    } else {
      last.thumbnail = picture_of(item);
    }
  }
  void begin(std::size_t end) {
    begin_ = next_;
    end_ = end;
    picture_due_ = false;
  }
  /// The child ended. That is the fault of a picture that was due; else of the
  /// next entry, if the child had seen nothing before it; else the rest is
  /// worth another child.
  void give_up(const core::Error& error) {
    if (picture_due_) {
      if (is_final(error)) all_[next_ - 1].error = error;
    } else if (next_ == begin_) {
      all_[next_++].error = error;
    }
    picture_due_ = false;
  }
  /// Whom the child's end would be told of.
  const std::filesystem::path& now() const {
    return entries_[picture_due_ ? next_ - 1 : std::min(next_, entries_.size() - 1)].shown;
  }
  std::size_t done() const { return next_; }
  std::vector<Description> all() && { return std::move(all_); }

 private:
  const std::vector<Entry>& entries_;
  bool pictures_;
  bool picture_due_ = false;
  std::vector<Description> all_;
  std::size_t begin_ = 0, end_ = 0, next_ = 0;
};

/// One child, from the first entry that nothing is known of. What a child
/// makes up is treated like its end.
void describe_some(const std::vector<Entry>& entries, Told& told, ReaderRequest request,
                   const core::Progress& progress, const ReaderLimits& limits) {
  constexpr std::size_t most_entries = 64;  // pictures of so many fit into what a child may say
  constexpr std::size_t most_files = 4096;
  const std::size_t from = told.done();
  std::size_t to = from;
  while (to < entries.size() && to - from < most_entries &&
         (to == from || request.paths.size() + entries[to].files.size() <= most_files)) {
    const auto& files = entries[to++].files;
    request.paths.insert(request.paths.end(), files.begin(), files.end());
    request.entries.push_back(files.size());
  }
  request.shown = entries[from].shown;
  told.begin(to);
  const auto take = [&](const nlohmann::json& item) {
    told.take(item);
    progress.report(static_cast<double>(told.done()) / static_cast<double>(entries.size()),
                    "Looking at " + told.now().filename().string());
  };
  try {
    run_reader(request, core::Progress({}, progress.cancel()), limits, take);
    if (told.done() != to)
      fail("reader-crashed", request.shown, "was not opened: the reader's answer makes no sense.");
  } catch (const core::Error& error) {
    if (error.kind() == core::ErrorKind::cancelled || error.code() == "reader-missing") throw;
    // The child's end was told with the name of the first.
    std::string text = error.what();
    const std::string first = request.shown.string();
    if (text.compare(0, first.size(), first) == 0) text.replace(0, first.size(), told.now().string());
    told.give_up(core::Error(error.kind(), error.code(), text, error.details()));
  } catch (const std::invalid_argument& error) {
    told.give_up(core::Error(core::ErrorKind::input, "reader-crashed",
                             told.now().string() + " was not opened: the reader's answer makes no sense.",
                             error.what()));
  }
}

}  // namespace

std::vector<Description> describe(const std::vector<Entry>& entries, const ReadOptions& options,
                                  bool thumbnails, const core::Progress& progress,
                                  const ReaderLimits& limits) {
  Told told(entries, thumbnails);
  ReaderRequest request;
  request.task = ReaderTask::describe;
  request.options = options;
  request.thumbnails = thumbnails;
  while (told.done() < entries.size()) describe_some(entries, told, request, progress, limits);
  std::vector<Description> all = std::move(told).all();
  for (std::size_t n = 0; n < all.size(); ++n)
    if (all[n].info) name_part(entries[n].uid, *all[n].info);
  return all;
}

}  // namespace palpate::imaging::reading

namespace palpate::imaging {

std::string reader_sandbox() {
  reading::ReaderRequest request;
  request.task = reading::ReaderTask::describe;
  try {
    const auto reply = reading::run_reader(request, {}, {});
    return reply.result.value("sandbox", "") == "seccomp" ? "seccomp" : "none";
  } catch (const core::Error& error) {
    // A reader that ends at once has told of nothing that holds it.
    if (error.code() == "reader-missing") throw;
    return "none";
  } catch (const nlohmann::json::exception&) {
    return "none";
  }
}

}  // namespace palpate::imaging
