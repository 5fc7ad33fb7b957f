#include "problem.hpp"

#include <numeric>

namespace problem {

double spectral_radius(const Matrix &m)
{
    return m.rows() == 0 ? 0.0 : m.eigenvalues().cwiseAbs().maxCoeff();
}

Matrix beside(const Matrix &a, const Matrix &b)
{
    Matrix out(a.rows(), a.cols() + b.cols());
    out << a, b;
    return out;
}

Matrix random_stable(Random &random, Eigen::Index n, double radius)
{
    Matrix       m = Matrix::Zero(n, n);
    Eigen::Index i = 0;
    while (i < n) {
        const double       rho  = random.real(0.0, radius);
        const double       turn = random.real(0.1, 3.0);
        const bool         pair = random.chance(0.4) && n - i >= 2;
        const Eigen::Index most = (n - i) / (pair ? 2 : 1);
        const Eigen::Index size = random.chance(0.5) ? 1 : std::min<Eigen::Index>(most, random.whole(2, 3)); /* of the Jordan block */
        for (Eigen::Index b = 0; b < size; ++b) {
            if (pair) {
                m.block(i, i, 2, 2) << rho * std::cos(turn), rho * std::sin(turn), -rho * std::sin(turn), rho * std::cos(turn);
                if (b > 0) { m.block(i - 2, i, 2, 2) = Matrix::Identity(2, 2); }
            } else {
                m(i, i) = random.chance(0.5) ? rho : (size > 1 ? rho : -rho);
                if (b > 0) { m(i - 1, i) = 1.0; m(i, i) = m(i - 1, i - 1); }
            }
            i += pair ? 2 : 1;
        }
    }
    Matrix basis = random.matrix(n, n).householderQr().householderQ();
    for (Eigen::Index c = 0; c < n; ++c) { basis.col(c) *= std::exp(random.real(-0.5, 0.5)); }
    return basis * m * basis.inverse();
}

oracle::Generator random_generator(Random &random)
{
    const int         s = random.whole(1, 8), r = random.whole(1, 3), width = random.whole(1, 6);
    const int         m = random.whole(0, width), p = width - m;
    const Matrix      stable = random_stable(random, s, 0.9);
    const bool        filter = random.chance(0.5);
    oracle::Generator g{stable, random.matrix(s, p), random.matrix(s, m), random.matrix(r, s), random.matrix(r, m), random.matrix(r, p),
                        random.matrix(s, r), random.matrix(r, r)};
    const auto other = [&]() -> Matrix { return filter ? Matrix(stable + g.Lo * g.W) : Matrix(stable - g.Lo * g.W); };
    while (spectral_radius(other()) > 0.95) {
        g.Lo *= 0.5;
    }
    if (filter) { g.G = other(); }
    return g;
}

System plain(const Matrix &A, const Matrix &B, const Matrix &C, const Matrix &D)
{
    return {A, B, C, D, A.cwiseAbs(), B.cwiseAbs(), C.cwiseAbs(), D.cwiseAbs()};
}

System fused(const oracle::Generator &g)
{
    System s = plain(g.G - g.Lo * g.W, beside(g.L + g.Lo * g.V, g.H - g.Lo * g.Qu), -g.Mo * g.W, g.Mo * beside(g.V, -g.Qu));
    const Matrix Lo = g.Lo.cwiseAbs(), Mo = g.Mo.cwiseAbs();
    s.A_abs = g.G.cwiseAbs() + Lo * g.W.cwiseAbs();
    s.B_abs = beside(g.L.cwiseAbs() + Lo * g.V.cwiseAbs(), g.H.cwiseAbs() + Lo * g.Qu.cwiseAbs());
    s.C_abs = Mo * g.W.cwiseAbs();
    s.D_abs = Mo * beside(g.V, g.Qu).cwiseAbs();
    return s;
}

System observer(const oracle::Generator &g) { return plain(g.G, beside(g.L, g.H), -g.W, beside(g.V, -g.Qu)); }

System filter(const oracle::Generator &g)
{
    System s = plain(g.G - g.Lo * g.W, g.Lo, -g.Mo * g.W, g.Mo);
    s.A_abs = g.G.cwiseAbs() + g.Lo.cwiseAbs() * g.W.cwiseAbs();
    s.C_abs = g.Mo.cwiseAbs() * g.W.cwiseAbs();
    return s;
}

System series(const oracle::Generator &g)
{
    const System       o = observer(g), f = filter(g);
    const Eigen::Index s = g.G.rows();
    const auto stack = [s](const Matrix &oA, const Matrix &oB, const Matrix &oC, const Matrix &oD, const Matrix &fA, const Matrix &fB,
                           const Matrix &fC, const Matrix &fD) {
        Matrix A = Matrix::Zero(2 * s, 2 * s), B(2 * s, oB.cols());
        A << oA, Matrix::Zero(s, s), fB * oC, fA;
        B << oB, fB * oD;
        return plain(A, B, beside(fD * oC, fC), fD * oD);
    };
    System       all = stack(o.A, o.B, o.C, o.D, f.A, f.B, f.C, f.D);
    const System abs = stack(o.A_abs, o.B_abs, o.C_abs, o.D_abs, f.A_abs, f.B_abs, f.C_abs, f.D_abs);
    all.A_abs = abs.A; all.B_abs = abs.B; all.C_abs = abs.C; all.D_abs = abs.D;
    return all;
}

Vector rounding(const System &s, Eigen::Index inner, const Vector &state_max, const Vector &input_max, double epsilon)
{
    const double gamma = static_cast<double>(s.A.cols() + s.B.cols() + inner + 3) * epsilon;
    const Vector step  = gamma * (s.A_abs * state_max + s.B_abs * input_max);
    Vector       total = gamma * (s.C_abs * state_max + s.D_abs * input_max);
    Matrix       response = s.C;
    for (int j = 0; j < 3000; ++j) {
        total += response.cwiseAbs() * step;
        response *= s.A;
    }
    return total;
}

std::vector<std::uint8_t> identity_places(Eigen::Index n)
{
    std::vector<std::uint8_t> places(static_cast<size_t>(n));
    std::iota(places.begin(), places.end(), static_cast<std::uint8_t>(0));
    return places;
}

std::vector<std::uint8_t> random_places(Random &random, Eigen::Index width, Eigen::Index of)
{
    std::vector<std::uint8_t> places = identity_places(of);
    for (size_t i = places.size() - 1; i > 0; --i) {
        std::swap(places[i], places[static_cast<size_t>(random.integer(0, static_cast<std::int64_t>(i)))]);
    }
    places.resize(static_cast<size_t>(width));
    return places;
}

Spectrum spectrum_of(const System &s)
{
    const Eigen::EigenSolver<Matrix> eigen(s.A);
    const Eigen::MatrixXcd           S = eigen.eigenvectors();
    return {eigen.eigenvalues().cwiseAbs(), (S.inverse() * s.B).cwiseAbs(), (s.C * S).cwiseAbs()};
}

Tail modal_tail(const System &s, const Taps &taps)
{
    const Spectrum m = spectrum_of(s);
    Tail           t{Vector::Constant(s.C.rows(), m.decay.maxCoeff()), Matrix(s.C.rows(), s.B.cols()), true};
    for (Eigen::Index g = 0; g < s.B.cols(); ++g) {
        const Vector power = m.decay.array().pow(taps[static_cast<size_t>(g)] - 1);
        t.weight.col(g)    = m.output * power.cwiseProduct(m.input.col(g));
    }
    return t;
}

Tail power_tail(const System &s, const Taps &taps)
{
    const auto norm = [](const Matrix &m) { return m.cwiseAbs().rowwise().sum().maxCoeff(); };
    Matrix power = s.A;
    double most = 1.0;
    int    q = 1;
    while (norm(power) >= 0.9) {
        most = std::max(most, norm(power));
        power *= s.A;
        ++q;
    }
    const double beta = norm(power), decay = (beta == 0.0) ? 0.5 : std::pow(beta, 1.0 / q);
    Tail t{Vector::Constant(s.C.rows(), decay), Matrix(s.C.rows(), s.B.cols()), false};
    for (Eigen::Index g = 0; g < s.B.cols(); ++g) {
        Matrix first = s.C;
        for (int j = 1; j < taps[static_cast<size_t>(g)]; ++j) { first *= s.A; }
        t.weight.col(g) = first.cwiseAbs().rowwise().sum() * most * std::pow(decay, 1 - q) * s.B.col(g).cwiseAbs().maxCoeff();
    }
    return t;
}

bool diagonalisable(const Matrix &A)
{
    const Eigen::EigenSolver<Matrix> eigen(A);
    const Eigen::MatrixXcd           S = eigen.eigenvectors();
    const Vector singular = Eigen::JacobiSVD<Eigen::MatrixXcd>(S).singularValues();
    const double residual = (A * S - S * eigen.eigenvalues().asDiagonal()).cwiseAbs().maxCoeff();
    return singular.minCoeff() > 1e-5 * singular.maxCoeff() && residual <= 1e-12 * (1.0 + A.cwiseAbs().maxCoeff());
}

Tail tail_of(Random &random, const System &s, const Taps &taps)
{
    Taps some;
    for (const int t : taps) { some.push_back(std::max(t, 1)); }
    Tail t = diagonalisable(s.A) ? modal_tail(s, some) : power_tail(s, some);
    for (double &decay : t.decay) { decay = std::max(0.05, decay + (random.chance(0.5) ? 0.0 : (1.0 - decay) * random.real(0.0, 0.5))); }
    for (Eigen::Index g = 0; g < t.weight.cols(); ++g) {
        if (taps[static_cast<size_t>(g)] == 0) { t.weight.col(g) = t.weight.col(g).cwiseQuotient(t.decay).cwiseMax(s.D.col(g).cwiseAbs()); }
    }
    return t;
}

void draw_observer(Random &random, Loop &l)
{
    const Eigen::Index n = l.plant.A.rows(), m = l.plant.C.rows();
    l.T = random.matrix(n, n) + 2.0 * Matrix::Identity(n, n);
    while (std::abs(l.T.determinant()) < 0.1) { l.T += Matrix::Identity(n, n); }
    Matrix gain = random.matrix(n, m);
    while (spectral_radius(l.plant.A - gain * l.plant.C) > 0.95) { gain *= 0.5; }
    oracle::Generator &g = l.generator;
    g.L  = l.T * gain;
    g.G  = l.T * (l.plant.A - gain * l.plant.C) * l.T.inverse();
    g.H  = l.T * l.plant.B - g.L * l.plant.D;
    g.W  = l.plant.C * l.T.inverse();
    g.V  = Matrix::Identity(m, m);
    g.Qu = l.plant.D;
    g.Lo = random.matrix(n, m);
    g.Mo = random.matrix(m, m);
    while (spectral_radius(g.G - g.Lo * g.W) > 0.95) { g.Lo *= 0.5; }
}

Loop random_loop(Random &random)
{
    const int n = random.whole(1, 6), m = random.whole(1, 3), p = random.whole(1, 2);
    Loop l;
    l.plant = {random_stable(random, n, 0.9), random.matrix(n, p), random.matrix(m, n), random.matrix(m, p),
               beside(0.1 * random.matrix(n, n), Matrix::Zero(n, m)), beside(Matrix::Zero(m, n), 0.1 * random.matrix(m, m))};
    l.initial = random.matrix(n, 1).cwiseAbs();
    draw_observer(random, l);
    return l;
}

Matrix bias_by_error(const Loop &l, int rows)
{
    const oracle::Generator &g  = l.generator;
    const Matrix             F  = g.G - g.Lo * g.W;
    const Matrix             Bd = l.T * l.plant.Ed - (g.L + g.Lo * g.V) * l.plant.Fd;
    Matrix bias(rows, g.Mo.rows());
    Matrix reach = g.Mo * g.W; /* Mo W F^k */
    Vector of_d  = (g.Mo * g.V * l.plant.Fd).cwiseAbs().rowwise().sum();
    for (int k = 0; k < rows; ++k) {
        bias.row(k) = ((reach * l.T).cwiseAbs() * l.initial + of_d).transpose();
        of_d += (reach * Bd).cwiseAbs().rowwise().sum();
        reach *= F;
    }
    return bias;
}

} // namespace problem
