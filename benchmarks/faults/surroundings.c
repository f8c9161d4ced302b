/* Loaded into every process of a graph (LD_PRELOAD): datagrams that get lost or are late, and a wall
   clock that jumps. What to do is in FAULT_DROP and FAULT_DELAY (shares of datagrams), FAULT_LATE [us],
   and in the file FAULT_CLOCK: a double, by how much the clock is ahead [s]. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

static double setting(const char *name) {
    const char *text = getenv(name);
    return text ? atof(text) : 0.0;
}

static int lost(int socket) {
    static double drop = -1.0, delay, late;
    static __thread unsigned seed;
    int type = 0;
    socklen_t size = sizeof type;
    struct sockaddr_storage address;
    socklen_t length = sizeof address;
    if (drop < 0.0) {
        delay = setting("FAULT_DELAY");
        late = setting("FAULT_LATE");
        drop = setting("FAULT_DROP");
    }
    if (drop + delay == 0.0 || getsockopt(socket, SOL_SOCKET, SO_TYPE, &type, &size) || type != SOCK_DGRAM)
        return 0;
    if (getsockname(socket, (struct sockaddr *)&address, &length) || address.ss_family != AF_INET)
        return 0;
    if (!seed)
        seed = (unsigned)getpid() ^ (unsigned)(size_t)&seed;
    double chance = rand_r(&seed) / (double)RAND_MAX;
    if (chance < drop)
        return 1;
    if (chance < drop + delay)
        usleep((useconds_t)late);
    return 0;
}

ssize_t sendmsg(int socket, const struct msghdr *message, int flags) {
    static ssize_t (*real)(int, const struct msghdr *, int);
    if (!real)
        real = (ssize_t(*)(int, const struct msghdr *, int))dlsym(RTLD_NEXT, "sendmsg");
    if (lost(socket)) {
        ssize_t sum = 0;
        for (size_t i = 0; i < message->msg_iovlen; i++)
            sum += (ssize_t)message->msg_iov[i].iov_len;
        return sum;
    }
    return real(socket, message, flags);
}

ssize_t sendto(int socket, const void *data, size_t size, int flags, const struct sockaddr *to, socklen_t length) {
    static ssize_t (*real)(int, const void *, size_t, int, const struct sockaddr *, socklen_t);
    if (!real)
        real = (ssize_t(*)(int, const void *, size_t, int, const struct sockaddr *, socklen_t))dlsym(RTLD_NEXT, "sendto");
    return lost(socket) ? (ssize_t)size : real(socket, data, size, flags, to, length);
}

int clock_gettime(clockid_t clock, struct timespec *now) {
    static int (*real)(clockid_t, struct timespec *);
    static volatile double *ahead;
    static double none = 0.0;
    if (!real) {
        const char *path = getenv("FAULT_CLOCK");
        int file = path ? open(path, O_RDONLY) : -1;
        void *map = file < 0 ? MAP_FAILED : mmap(NULL, sizeof none, PROT_READ, MAP_SHARED, file, 0);
        ahead = map == MAP_FAILED ? &none : map;
        real = (int (*)(clockid_t, struct timespec *))dlsym(RTLD_NEXT, "clock_gettime");
    }
    int code = real(clock, now);
    if (clock == CLOCK_REALTIME && !code)
        now->tv_sec += (time_t)*ahead;
    return code;
}
