/** @file
 *  Tables of the library from the problems of problem.hpp, in the number type the library is built with. */
#ifndef HULLGUARD_TESTS_TABLES_HPP
#define HULLGUARD_TESTS_TABLES_HPP

#include "problem.hpp"

#include <numeric>

extern "C" {
#include "hullguard/hull.h"
#include "hullguard/residual.h"
}

namespace problem {

using Reals = std::vector<hg_real>;

constexpr double unit = static_cast<double>(std::numeric_limits<hg_real>::epsilon()); /* two units of rounding of the library's number */

inline hg_real nearest(double x) { return static_cast<hg_real>(x); }

inline hg_real round_up(double x)
{
    const hg_real y = nearest(x);
    return (static_cast<double>(y) < x) ? std::nextafter(y, std::numeric_limits<hg_real>::infinity()) : y;
}

inline Reals row_major(const Matrix &m)
{
    Reals out;
    for (Eigen::Index i = 0; i < m.rows(); ++i) {
        for (Eigen::Index j = 0; j < m.cols(); ++j) {
            out.push_back(nearest(m(i, j)));
        }
    }
    return out;
}

/* Tables of a residual generator in the library's number. */
struct Residual {
    Reals                     A, B, C, D, memory;
    std::vector<std::uint8_t> signal;
    hg_residual_config        config{};
    hg_residual               self{};

    Residual(const System &s, const std::vector<std::uint8_t> &places)
        : A(row_major(s.A)), B(row_major(s.B)), C(row_major(s.C)), D(row_major(s.D)), signal(places)
    {
        const auto n = static_cast<std::uint8_t>(s.A.rows()), r = static_cast<std::uint8_t>(s.C.rows());
        const auto w = static_cast<std::uint8_t>(s.B.cols());
        config = {n, r, w, signal.data(), {n, n, 0, A.data()}, {n, w, 0, B.data()}, {r, n, 0, C.data()}, {r, w, 0, D.data()}};
        memory.resize(HG_RESIDUAL_REALS(n, w));
    }
    Residual(const Residual &) = delete;
    Residual &operator=(const Residual &) = delete;
    bool start() { return hg_residual_start(&self, &config, memory.data()) == HG_OK; }
};

/* Tables of a hull. Every table is widened by what the sums of the library can lose (platoon, section 8), then rounded up. */
struct HullTables {
    Reals                     weight, rest, moving, rest_left, moving_left, bias, decay;
    std::vector<std::uint8_t> signal, taps;
    hg_hull_config            config{};

    HullTables(const System &s, const std::vector<std::uint8_t> &places, const Taps &lags, const Bias &start, const Tail &behind, int ready_rest,
               int ready_moving)
        : signal(places), taps(lags.begin(), lags.end())
    {
        const double widen = 1.0 + unit * (10.0 + 2.0 * static_cast<double>(s.B.cols()) + std::accumulate(lags.begin(), lags.end(), 0.0));
        lay_out(s, behind, widen);
        append(rest, start.rest * widen);
        append(moving, start.moving * widen);
        append(rest_left, start.rest_left * widen);
        append(moving_left, start.moving_left * widen);
        append(bias, start.later * widen);
        append(decay, behind.decay * (1.0 + 8.0 * unit));
        config.residuals    = static_cast<std::uint8_t>(s.C.rows());
        config.width        = static_cast<std::uint8_t>(s.B.cols());
        config.signal       = signal.data();
        config.taps         = taps.data();
        config.weight       = weight.data();
        config.settle       = static_cast<std::uint16_t>(start.rest.rows());
        config.rest         = rest.data();
        config.rest_left    = rest_left.data();
        config.moving       = moving.data();
        config.moving_left  = moving_left.data();
        config.bias         = bias.data();
        config.ready_rest   = static_cast<std::uint16_t>(ready_rest);
        config.ready_moving = static_cast<std::uint16_t>(ready_moving);
        config.decay        = decay.data();
    }
    HullTables(const HullTables &) = delete;
    HullTables &operator=(const HullTables &) = delete;

    /* hull.h: of each two residuals signal after signal, lag after lag, and the tail behind the lags. */
    void lay_out(const System &s, const Tail &behind, double widen)
    {
        std::vector<Matrix> response{s.D.cwiseAbs()};
        Matrix              lag = s.B;
        for (int j = 1; j < *std::max_element(taps.begin(), taps.end()); ++j) {
            response.push_back((s.C * lag).cwiseAbs());
            lag = s.A * lag;
        }
        for (Eigen::Index i = 0; i < s.C.rows(); i += 2) {
            const Eigen::Index both = std::min<Eigen::Index>(2, s.C.rows() - i);
            for (Eigen::Index g = 0; g < s.B.cols(); ++g) {
                for (size_t j = 0; j < taps[static_cast<size_t>(g)]; ++j) { append(weight, response[j].block(i, g, both, 1) * widen); }
                append(weight, behind.weight.block(i, g, both, 1) * widen);
            }
        }
    }

    static void append(Reals &table, const Matrix &rows)
    {
        for (Eigen::Index i = 0; i < rows.rows(); ++i) {
            for (Eigen::Index j = 0; j < rows.cols(); ++j) { table.push_back(round_up(rows(i, j))); }
        }
    }
};

/* Radii of one sample: bursts, long silences (a radius that grows), nothing. */
inline void random_radii(Random &random, Reals &radius, std::vector<int> &mode)
{
    for (size_t i = 0; i < radius.size(); ++i) {
        if (random.chance(0.05)) { mode[i] = random.whole(0, 3); }
        const double old = static_cast<double>(radius[i]);
        radius[i] = nearest(mode[i] == 0 ? 0.0 : mode[i] == 1 ? random.real(0.0, 1.0) : mode[i] == 2 ? std::min(50.0, old * 1.1 + 0.01) : old);
    }
}

/* Seed and length of a run, from the environment. */
inline void begin_run()
{
    const char *seed = std::getenv("HULLGUARD_SEED");
    the_seed = seed != nullptr ? std::strtoull(seed, nullptr, 10) : std::random_device{}();
    const char *many = std::getenv("HULLGUARD_PROBLEMS");
    problems = many != nullptr ? std::atoi(many) : problems;
    std::printf("HULLGUARD_SEED=%llu (%s)\n", static_cast<unsigned long long>(the_seed), sizeof(hg_real) == 8 ? "float64" : "float32");
}

} // namespace problem

#endif
