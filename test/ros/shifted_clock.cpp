// A system clock that goes wrong: preloaded, it adds to CLOCK_REALTIME the int64 nanoseconds that stand at the start of
// the file CLOCK_SHIFT, now; who writes there makes the clock jump.
#include <dlfcn.h>
#include <fcntl.h>
#include <pthread.h>
#include <sys/mman.h>
#include <sys/time.h>
#include <time.h>

#include <cstdint>
#include <cstdlib>

namespace {

std::int64_t shift() {
  static const auto* const shared = [] {
    const int file = open(std::getenv("CLOCK_SHIFT"), O_RDONLY);
    void* const memory = mmap(nullptr, sizeof(std::int64_t), PROT_READ, MAP_SHARED, file, 0);
    return memory == MAP_FAILED ? nullptr : static_cast<const volatile std::int64_t*>(memory);
  }();
  return shared ? *shared : 0;
}

}  // namespace

extern "C" int clock_gettime(clockid_t clock, timespec* time) {
  static const auto real = reinterpret_cast<int (*)(clockid_t, timespec*)>(dlsym(RTLD_NEXT, "clock_gettime"));
  const int failed = real(clock, time);
  if (failed || clock != CLOCK_REALTIME) return failed;
  const std::int64_t now = time->tv_sec * std::int64_t(1000000000) + time->tv_nsec + shift();
  time->tv_sec = now / 1000000000 - (now % 1000000000 < 0);
  time->tv_nsec = (now % 1000000000 + 1000000000) % 1000000000;
  return 0;
}

extern "C" int gettimeofday(timeval* time, void*) noexcept {
  timespec now;
  clock_gettime(CLOCK_REALTIME, &now);
  time->tv_sec = now.tv_sec;
  time->tv_usec = now.tv_nsec / 1000;
  return 0;
}

extern "C" time_t time(time_t* place) noexcept {
  timespec now;
  clock_gettime(CLOCK_REALTIME, &now);
  if (place) *place = now.tv_sec;
  return now.tv_sec;
}

// The system waits by the true clock: a wait until a time of the shifted one. Times of the steady clock are small.
extern "C" int pthread_cond_timedwait(pthread_cond_t* condition, pthread_mutex_t* mutex, const timespec* until) {
  using Wait = int (*)(pthread_cond_t*, pthread_mutex_t*, const timespec*);
  static void* const newer = dlvsym(RTLD_NEXT, "pthread_cond_timedwait", "GLIBC_2.3.2");   // x86 has an older one too
  static const auto real = reinterpret_cast<Wait>(newer ? newer : dlsym(RTLD_NEXT, "pthread_cond_timedwait"));
  timespec true_time = *until;
  if (until->tv_sec > 100000000) true_time.tv_sec -= shift() / 1000000000;
  return real(condition, mutex, &true_time);
}
