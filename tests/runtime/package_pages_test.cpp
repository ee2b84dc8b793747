// What a use does not want of a mapped package is never paged in: in fixed point, of an avatar that
// has floats too, neither opening nor drawing touches a page of the floats. Shown twice: by pages
// that end the program if they are touched, and by counting those that the system has in memory.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "runtime/splat_scene.h"
#include "runtime/test_packages.h"

namespace figurine::package_pages_test {
namespace {

using tests::SyntheticAvatar;
using tests::SyntheticBody;

size_t page_bytes() { return static_cast<size_t>(::sysconf(_SC_PAGESIZE)); }

// Channels enough that every layer's floats cover whole pages.
SyntheticAvatar make_avatar(const SyntheticBody& body) {
  return tests::make_test_avatar(
      body, {.channels = 24, .fourier_octaves = 0, .held = tests::Held::kBoth});
}

// Numbers of the pages that lie within tensors that the package leaves out.
std::vector<size_t> unwanted_pages(const Package& package) {
  const size_t page = page_bytes();
  std::vector<size_t> pages;
  for (const TensorInfo& tensor : package.tensors()) {
    if (tensor.wanted) continue;
    const uint64_t end = tensor.offset_bytes + tensor.size_bytes;
    for (uint64_t at = (tensor.offset_bytes + page - 1) / page; (at + 1) * page <= end; ++at)
      pages.push_back(at);
  }
  return pages;
}

std::vector<uint8_t> draw(const Package& avatar, const Package& body) {
  const std::unique_ptr<Renderer> renderer = tests::make_renderer(2);
  const Result<AvatarId> id = renderer->add_avatar(avatar, body);
  FIG_CHECK(id.ok(), id.status().message().c_str());
  const tests::SyntheticPose pose = tests::make_test_pose(body.body(), 1);
  const FrameAvatar seen[] = {{.avatar = *id, .pose = pose.view()}};
  std::vector<uint8_t> rgba(64 * 64 * 4);
  const Status status =
      renderer->render({.camera = tests::make_test_camera(64, 64), .avatars = seen},
                       {.pixels = rgba.data(), .stride_bytes = 256});
  EXPECT_TRUE(status.ok()) << status.message();
  return rgba;
}

TEST(PackagePages, WhatIsNotWantedMayBeUnreadable) {
  const SyntheticBody body = tests::make_test_body({.uv_size = 16});
  const SyntheticAvatar avatar = make_avatar(body);
  const std::span<const std::byte> bytes = avatar.bytes.bytes();
  void* const map =
      ::mmap(nullptr, bytes.size(), PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  ASSERT_NE(map, MAP_FAILED);
  std::memcpy(map, bytes.data(), bytes.size());
  const std::span<const std::byte> copy(static_cast<const std::byte*>(map), bytes.size());
  const auto first = Package::open(copy, "person.fgn", OpenOptions::for_drawing());
  ASSERT_TRUE(first.ok()) << first.status().message();
  const std::vector<size_t> pages = unwanted_pages(*first);
  ASSERT_GT(pages.size(), 50u);
  for (const size_t at : pages)
    ASSERT_EQ(::mprotect(static_cast<std::byte*>(map) + at * page_bytes(), page_bytes(), PROT_NONE),
              0);
  // A touch from here on ends the program.
  const auto opened = Package::open(copy, "person.fgn", OpenOptions::for_drawing());
  ASSERT_TRUE(opened.ok()) << opened.status().message();
  EXPECT_EQ(draw(*opened, *body.package), draw(*avatar.package, *body.package));
  EXPECT_TRUE(Package::identify(copy, "person.fgn").ok());
  ::munmap(map, bytes.size());
}

// The file in a folder whose file system can forget pages; -1 where none can.
class ColdFile {
 public:
  explicit ColdFile(std::span<const std::byte> bytes) {
    path_ = testing::TempDir() + "/figurine_pages_XXXXXX";
    fd_ = ::mkstemp(path_.data());
    FIG_CHECK(
        fd_ >= 0 && ::write(fd_, bytes.data(), bytes.size()) == static_cast<ssize_t>(bytes.size()),
        "a file in the temporary folder");
    ::unlink(path_.c_str());
    ::fsync(fd_);
    ::posix_fadvise(fd_, 0, 0, POSIX_FADV_DONTNEED);
    void* const map = ::mmap(nullptr, bytes.size(), PROT_READ, MAP_SHARED, fd_, 0);
    FIG_CHECK(map != MAP_FAILED, "a memory map");
    // One page a fault: without it the system reads on for a guess, which is no use of ours.
    ::madvise(map, bytes.size(), MADV_RANDOM);
    bytes_ = {static_cast<const std::byte*>(map), bytes.size()};
  }
  ~ColdFile() {
    ::munmap(const_cast<std::byte*>(bytes_.data()), bytes_.size());
    ::close(fd_);
  }
  ColdFile(const ColdFile&) = delete;
  std::span<const std::byte> bytes() const { return bytes_; }

  std::vector<bool> resident() const {
    std::vector<unsigned char> pages((bytes_.size() + page_bytes() - 1) / page_bytes());
    EXPECT_EQ(::mincore(const_cast<std::byte*>(bytes_.data()), bytes_.size(), pages.data()), 0);
    std::vector<bool> in_memory;
    for (const unsigned char page : pages) in_memory.push_back((page & 1) != 0);
    return in_memory;
  }

 private:
  std::string path_;
  int fd_ = -1;
  std::span<const std::byte> bytes_;
};

size_t count(const std::vector<bool>& pages) {
  return static_cast<size_t>(std::count(pages.begin(), pages.end(), true));
}

TEST(PackagePages, WhatIsNotWantedIsNotInMemoryAfterOpeningAndDrawing) {
  const SyntheticBody body = tests::make_test_body({.uv_size = 16});
  const SyntheticAvatar avatar = make_avatar(body);
  const ColdFile file(avatar.bytes.bytes());
  const size_t all = file.resident().size();
  if (count(file.resident()) > 0)
    GTEST_SKIP() << "this file system keeps its pages in memory: " << count(file.resident())
                 << " of " << all;
  ASSERT_TRUE(Package::identify(file.bytes(), "person.fgn").ok());
  const size_t identified = count(file.resident());
  const auto opened = Package::open(file.bytes(), "person.fgn", OpenOptions::for_drawing());
  ASSERT_TRUE(opened.ok()) << opened.status().message();
  const size_t after_opening = count(file.resident());
  draw(*opened, *body.package);
  const std::vector<bool> after_drawing = file.resident();
  const std::vector<size_t> unwanted = unwanted_pages(*opened);
  std::printf("pages of %zu: %zu to identify, %zu to open, %zu to draw; %zu are of no use\n", all,
              identified, after_opening, count(after_drawing), unwanted.size());
  ASSERT_GT(unwanted.size(), all / 2) << "floats are most of the package";
  for (const size_t at : unwanted) EXPECT_FALSE(after_drawing[at]) << "page " << at;
  EXPECT_LE(identified * page_bytes(), kPackageHeaderBytes + opened->index_bytes() + page_bytes());
  EXPECT_EQ(count(after_drawing), after_opening) << "all that is wanted was verified";
  // Whoever opens it whole reads all of it.
  ASSERT_TRUE(Package::open(file.bytes(), "person.fgn").ok());
  EXPECT_EQ(count(file.resident()), all);
}

}  // namespace
}  // namespace figurine::package_pages_test
