// Files appear whole or not at all, and errors name the path and the system's reason.
#include "ports/host/files.h"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "ports/host/atomic_file.h"
#include "ports/host/clock.h"
#include "ports/host/folder_lock.h"

namespace figurine::ports::files_test {
namespace {

class Files : public testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = testing::TempDir() + "/figurine_files_XXXXXX";
    ASSERT_NE(::mkdtemp(pattern.data()), nullptr);
    folder_ = pattern;
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string path(const std::string& name) const { return folder_ + "/" + name; }
  size_t entries() const {
    size_t n = 0;
    for (const auto& entry : std::filesystem::directory_iterator(folder_)) n += entry.exists();
    return n;
  }
  static std::span<const std::byte> bytes(const std::string& text) {
    return std::as_bytes(std::span(text));
  }
  static std::string text(std::span<const std::byte> data) {
    return {reinterpret_cast<const char*>(data.data()), data.size()};
  }

  std::string folder_;
};

TEST_F(Files, WrittenBytesAreMappedBack) {
  std::string content(3 * 4096 + 17, '\0');
  for (size_t i = 0; i < content.size(); ++i) content[i] = static_cast<char>(i * 31 + (i >> 8));
  ASSERT_TRUE(write_file_atomically(path("a.bin"), bytes(content)).ok());
  const Result<MappedFile> mapped = MappedFile::open(path("a.bin"));
  ASSERT_TRUE(mapped.ok()) << mapped.status().message();
  EXPECT_EQ(text(mapped->bytes()), content);
  EXPECT_EQ(reinterpret_cast<uintptr_t>(mapped->bytes().data()) % 64, 0u);
  EXPECT_EQ(entries(), 1u) << "no temporary stays behind";
}

TEST_F(Files, AMapOutlivesTheReplacementOfItsFile) {
  ASSERT_TRUE(write_file_atomically(path("a"), bytes("old content")).ok());
  const Result<MappedFile> old = MappedFile::open(path("a"));
  ASSERT_TRUE(old.ok());
  ASSERT_TRUE(write_file_atomically(path("a"), bytes("new")).ok());
  EXPECT_EQ(text(old->bytes()), "old content");
  const Result<MappedFile> fresh = MappedFile::open(path("a"));
  ASSERT_TRUE(fresh.ok());
  EXPECT_EQ(text(fresh->bytes()), "new");
}

TEST_F(Files, MovingAMapMovesItsBytes) {
  ASSERT_TRUE(write_file_atomically(path("a"), bytes("first")).ok());
  ASSERT_TRUE(write_file_atomically(path("b"), bytes("second")).ok());
  Result<MappedFile> a = MappedFile::open(path("a"));
  Result<MappedFile> b = MappedFile::open(path("b"));
  ASSERT_TRUE(a.ok() && b.ok());
  MappedFile moved(std::move(*a));
  EXPECT_TRUE(a->bytes().empty());
  EXPECT_EQ(text(moved.bytes()), "first");
  moved = std::move(*b);
  EXPECT_EQ(text(moved.bytes()), "second");
}

TEST_F(Files, EmptyFileMapsToEmptySpan) {
  ASSERT_TRUE(write_file_atomically(path("empty"), {}).ok());
  const Result<MappedFile> mapped = MappedFile::open(path("empty"));
  ASSERT_TRUE(mapped.ok());
  EXPECT_TRUE(mapped->bytes().empty());
}

TEST_F(Files, NewFileHasTheModeOfTheUmask) {
  const mode_t mask = ::umask(022);
  const Status status = write_file_atomically(path("a"), bytes("x"));
  ::umask(mask);
  ASSERT_TRUE(status.ok());
  struct stat info;
  ASSERT_EQ(::stat(path("a").c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 0777, 0644u);
}

TEST_F(Files, MissingFileIsNotFoundAndNamed) {
  const Result<MappedFile> mapped = MappedFile::open(path("nowhere.fgn"));
  ASSERT_FALSE(mapped.ok());
  EXPECT_EQ(mapped.status().code(), StatusCode::kNotFound);
  EXPECT_NE(mapped.status().message().find("nowhere.fgn"), std::string::npos);
  EXPECT_NE(mapped.status().message().find("No such file"), std::string::npos);
}

TEST_F(Files, FolderIsNotAFile) {
  EXPECT_EQ(MappedFile::open(folder_).status().code(), StatusCode::kIo);
  EXPECT_EQ(write_file_atomically(folder_, bytes("x")).code(), StatusCode::kIo);
}

TEST_F(Files, DeviceIsNeitherMappedNorReplaced) {
  EXPECT_EQ(MappedFile::open("/dev/null").status().code(), StatusCode::kIo);
  EXPECT_EQ(write_file_atomically("/dev/null", bytes("x")).code(), StatusCode::kIo);
  struct stat info;
  ASSERT_EQ(::stat("/dev/null", &info), 0);
  EXPECT_TRUE(S_ISCHR(info.st_mode));
}

TEST_F(Files, OneLockHoldsAFolder) {
  {
    Result<FolderLock> lock = FolderLock::acquire(folder_);
    ASSERT_TRUE(lock.ok()) << lock.status().message();
    EXPECT_EQ(FolderLock::acquire(folder_).status().message(),
              folder_ + ": another process is at work in it");
    const FolderLock moved = std::move(*lock);
    EXPECT_FALSE(FolderLock::acquire(folder_).ok());
    EXPECT_EQ(entries(), 0u) << "it leaves no file";
  }
  EXPECT_TRUE(FolderLock::acquire(folder_).ok());
  {
    const Result<FolderLock> one = FolderLock::share(folder_), other = FolderLock::share(folder_);
    EXPECT_TRUE(one.ok() && other.ok());
    EXPECT_FALSE(FolderLock::acquire(folder_).ok()) << "two share it";
  }
  const Result<FolderLock> alone = FolderLock::acquire(folder_);
  ASSERT_TRUE(alone.ok());
  EXPECT_FALSE(FolderLock::share(folder_).ok()) << "one has it for himself";
  EXPECT_NE(
      FolderLock::acquire(path("nowhere")).status().message().find("nowhere: cannot be opened"),
      std::string::npos);
}

TEST_F(Files, APipeIsRefusedAndNotWaitedFor) {
  ASSERT_EQ(::mkfifo(path("pipe").c_str(), 0600), 0);
  const Status mapped = MappedFile::open(path("pipe")).status();
  EXPECT_EQ(mapped.message(), path("pipe") + ": cannot read: not a regular file");
  EXPECT_EQ(check_regular_file(path("pipe")).message(), mapped.message());
  EXPECT_EQ(check_regular_file(path("nowhere")).code(), StatusCode::kNotFound);
  ASSERT_TRUE(write_file_atomically(path("a"), bytes("x")).ok());
  EXPECT_TRUE(check_regular_file(path("a")).ok());
}

TEST_F(Files, ALinkStaysAndWhatItPointsToIsReplaced) {
  ASSERT_EQ(::mkdir(path("far").c_str(), 0700), 0);
  ASSERT_TRUE(write_file_atomically(path("far/target"), bytes("old")).ok());
  for (const auto& [link, target] :
       {std::pair("absolute", path("far/target")), std::pair("relative", std::string("far/target")),
        std::pair("dangling", std::string("far/new"))}) {
    ASSERT_EQ(::symlink(target.c_str(), path(link).c_str()), 0);
    ASSERT_TRUE(write_file_atomically(path(link), bytes(link)).ok()) << link;
    EXPECT_TRUE(std::filesystem::is_symlink(path(link))) << link;
    EXPECT_EQ(text(MappedFile::open(path(link))->bytes()), link);
  }
  EXPECT_EQ(text(MappedFile::open(path("far/target"))->bytes()), "relative");
  ASSERT_EQ(::symlink("loop", path("loop").c_str()), 0);
  EXPECT_FALSE(write_file_atomically(path("loop"), bytes("x")).ok());
}

// The folder's first writer in a process removes what killed ones left, and nothing that lives.
TEST_F(Files, TemporariesOfKilledProcessesAreSwept) {
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    Result<AtomicFile> file = AtomicFile::create(path("killed"));
    if (file.ok()) (void)file->write(bytes("half"));
    ::_exit(0);  // no destructor, as after SIGKILL
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  ASSERT_EQ(entries(), 1u);
  std::ofstream(path(".mine.tmp")) << "not ours";
  std::ofstream(path(".x.zzzzzzzz-1-0.figurine.tmp")) << "of another machine, young";
  Result<AtomicFile> living = AtomicFile::create(path("living"));
  ASSERT_TRUE(living.ok());
  EXPECT_EQ(entries(), 3u) << "the killed one's is gone";
  sweep_temporaries(folder_);
  EXPECT_EQ(entries(), 3u);
  std::filesystem::last_write_time(
      path(".x.zzzzzzzz-1-0.figurine.tmp"),
      std::filesystem::file_time_type::clock::now() - std::chrono::hours(25));
  sweep_temporaries(folder_);
  EXPECT_EQ(entries(), 2u);
  EXPECT_TRUE(living->commit().ok());
}

TEST_F(Files, ALockMayBeWaitedFor) {
  Result<FolderLock> lock = FolderLock::acquire(folder_);
  ASSERT_TRUE(lock.ok());
  const uint64_t start = now_ns();
  EXPECT_FALSE(FolderLock::acquire(folder_, 0.1).ok());
  EXPECT_GE(now_ns() - start, 100'000'000u);
}

TEST_F(Files, LongNamesHaveTemporariesToo) {
  const std::string name(250, 'n');
  EXPECT_TRUE(write_file_atomically(path(name), bytes("x")).ok());
  EXPECT_EQ(entries(), 1u);
}

TEST_F(Files, WriteIntoMissingFolderLeavesNothing) {
  const Status status = write_file_atomically(path("no/such/file"), bytes("x"));
  EXPECT_EQ(status.code(), StatusCode::kNotFound);
  EXPECT_NE(status.message().find("no/such/file"), std::string::npos);
  EXPECT_EQ(entries(), 0u);
}

}  // namespace
}  // namespace figurine::ports::files_test
