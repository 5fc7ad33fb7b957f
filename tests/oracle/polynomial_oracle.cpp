#include "polynomial_oracle.hpp"

namespace oracle {

namespace {

double split_weight(double mean) { return std::clamp(std::sqrt(std::max(mean, 0.0)), 1e-4, 10.0); }

/* Share by which a weight can be off whose square is a mean of shares. */
double part(double size, double value) { return (value > 0.0) ? size / value : 0.0; }

/* All of some variables. */
Sized linear_part(const std::vector<Series> &rows, int first, int count)
{
    Sized found{Matrix(rows.size(), count), Matrix(rows.size(), count)};
    for (size_t i = 0; i < rows.size(); ++i) {
        found.value.row(static_cast<Eigen::Index>(i)) = rows[i].value[1].segment(first, count).transpose();
        found.size.row(static_cast<Eigen::Index>(i)) = rows[i].size[1].segment(first, count).transpose();
    }
    return found;
}

Sized diagonal(const Vector &v) { return exact(Matrix(v.asDiagonal())); }

Sized chosen(const Sized &m, const std::vector<int> &rows, const std::vector<int> &columns)
{
    return {m.value(rows, columns), m.size(rows, columns)};
}

std::vector<int> counted(int first, int count)
{
    std::vector<int> list;
    for (int i = 0; i < count; ++i) {
        list.push_back(first + i);
    }
    return list;
}

} // namespace

PolynomialFilter::PolynomialFilter(const PolynomialPlant &plant, int degree, bool bounded, const PolynomialLevels &levels)
    : n_(plant.states()), p_(plant.outputs()), mu_(degree), all_(2 * n_ + p_), top_(bounded ? degree + 1 : degree), plant_(plant), levels_(levels), bounded_(bounded)
{
    X = tuples(n_, mu_);
    Y = tuples(p_, mu_);
    Y.erase(Y.begin());
    noises_ = tuples(n_ + p_, mu_);
    ring_ = tuples(all_, top_);
    state_place_ = places(X);
    const std::map<Tuple, int> ring_place = places(ring_), noise_place = places(noises_);
    Eigen::Index entries = 1;
    for (int k = 0; k <= top_; ++k, entries *= all_) {
        collected_.emplace_back();
        for (Eigen::Index at = 0; at < entries; ++at) {
            Tuple t;
            for (Eigen::Index left = at, i = 0; i < k; ++i, left /= all_) {
                t.push_back(static_cast<int>(left % all_));
            }
            std::sort(t.begin(), t.end());
            collected_.back().push_back(ring_place.at(t));
        }
    }
    for (const Tuple &t : ring_) {
        parts_.emplace_back();
        for (int i : t) {
            (i < n_ ? parts_.back().first : parts_.back().second).push_back(i < n_ ? i : i - n_);
        }
    }
    for (size_t m = 0; m < ring_.size(); ++m) {
        const bool kept = ring_[m].size() <= static_cast<size_t>(mu_);
        root_.push_back(root_of_square(parts_[m].second));
        noise_at_.push_back(kept ? static_cast<size_t>(noise_place.at(parts_[m].second)) : 0);
        state_at_.push_back(kept ? state_place_.at(parts_[m].first) : 0);
    }
    for (size_t a = 0; a < noises_.size(); ++a) {
        noise_mean_.push_back(mean_of(noises_[a], {}));
        for (size_t b = 0; b < noises_.size(); ++b) {
            const double covariance = covariance_of(noises_[a], noises_[b]);
            if (covariance != 0.0) {
                correlated_.push_back({a, b, covariance});
            }
        }
    }
    const Matrix m = moments();
    const Eigen::Index N = m.rows() - 1;
    M = exact(m);
    z = exact(m.col(0));
    P = exact(m.bottomRightCorner(N, N) - m.col(0).tail(N) * m.col(0).tail(N).transpose());
    c = exact(plant.x0);
    Pe = diagonal(plant.P0);
    mean = Vector::Zero(p_);
}

Matrix PolynomialFilter::moments() const
{
    Matrix m(X.size(), X.size());
    for (size_t a = 0; a < X.size(); ++a) {
        for (size_t b = 0; b < X.size(); ++b) { /* E prod (x0_i + normal_i)^k */
            double product = 1.0;
            for (int i = 0; i < n_; ++i) {
                const auto k = std::count(X[a].begin(), X[a].end(), i) + std::count(X[b].begin(), X[b].end(), i);
                product *= Noise{plant_.P0(i), false}.moment(static_cast<int>(k));
            }
            m(static_cast<Eigen::Index>(a), static_cast<Eigen::Index>(b)) = product;
        }
    }
    return m;
}

double PolynomialFilter::mean_of(const Tuple &a, const Tuple &b) const
{
    double product = 1.0;
    for (int i = 0; i < n_ + p_; ++i) {
        const auto k = std::count(a.begin(), a.end(), i) + std::count(b.begin(), b.end(), i);
        product *= plant_.noise[static_cast<size_t>(i)].moment(static_cast<int>(k));
    }
    return product;
}

Series PolynomialFilter::put_in(const std::vector<Term> &row, const std::vector<Series> &states) const
{
    Series sum(all_, top_);
    for (const Term &t : row) {
        Series product(all_, top_);
        product.add(0, 0, t.coefficient, std::abs(t.coefficient));
        for (int i : t.factor) {
            product = product * states[static_cast<size_t>(i)];
        }
        sum.add(product, 1.0, 0.0);
    }
    return sum;
}

/* H, F, and the auxiliary filter's own course: its covariance in the short form F1 (Pe - L S L') F1' + Q. */
void PolynomialFilter::auxiliary(const Vector &y, const Vector &radius, std::vector<Series> &H, std::vector<Series> &F)
{
    std::vector<Series> shift(static_cast<size_t>(n_), Series(all_, top_));
    for (int l = 0; l < n_; ++l) {
        shift[static_cast<size_t>(l)].add(0, 0, c.value(l), std::abs(c.value(l)));
        shift[static_cast<size_t>(l)].add(1, l, 1.0, 1.0);
    }
    eta_ = {Matrix::Zero(p_, 1), Matrix::Zero(p_, 1)};
    std::vector<int> fresh;
    for (int j = 0; j < p_; ++j) {
        H.push_back(put_in(plant_.h[static_cast<size_t>(j)], shift));
        const double size = H.back().size[0](0), at = H.back().drop_constant();
        if (std::isfinite(radius(j))) {
            eta_.value(j) = y(j) - at;
            eta_.size(j) = size + std::abs(y(j));
        }
        if (radius(j) <= levels_.fresh(j)) {
            fresh.push_back(j);
        }
        H.back().add(1, 2 * n_ + j, 1.0, 1.0);
    }
    const Sized H1 = linear_part(H, 0, n_), exact_Pe = exact(Pe.value);
    Vector Q(n_), R(p_);
    for (int i = 0; i < n_ + p_; ++i) {
        (i < n_ ? Q(i) : R(i - n_)) = plant_.noise[static_cast<size_t>(i)].variance;
    }
    const Sized PH = exact_Pe * transposed(H1), S = H1 * PH + diagonal(R);
    Sized L{Matrix::Zero(n_, p_), Matrix::Zero(n_, p_)};
    if (!fresh.empty()) {
        const Sized some = divided(chosen(PH, counted(0, n_), fresh), chosen(S, fresh, fresh));
        L.value(Eigen::all, fresh) = some.value;
        L.size(Eigen::all, fresh) = some.size;
    }
    for (int j : fresh) {
        mean(j) += levels_.weight * (eta_.value(j) / std::sqrt(S.value(j, j)) - mean(j));
    }
    drift = mean.cwiseAbs2().maxCoeff() * (2.0 - levels_.weight) / levels_.weight;
    ekf = exact(c.value) + L * eta_;
    for (int l = 0; l < n_; ++l) {
        Series &s = shift[static_cast<size_t>(l)];
        s.drop_constant();
        s.add(0, 0, ekf.value(l), ekf.size(l));
        for (int j = 0; j < p_; ++j) {
            s.add(H[static_cast<size_t>(j)], -L.value(l, j), L.size(l, j));
        }
    }
    Matrix slope = Matrix::Zero(n_, n_);
    for (int l = 0; l < n_; ++l) {
        F.push_back(put_in(plant_.f[static_cast<size_t>(l)], shift));
        c.size(l) = F.back().size[0](0);
        c.value(l) = F.back().drop_constant();
        F.back().add(1, n_ + l, 1.0, 1.0);
        for (const Term &t : plant_.f[static_cast<size_t>(l)]) {
            for (size_t i = 0; i < t.factor.size(); ++i) {
                Term rest = t;
                rest.factor.erase(rest.factor.begin() + static_cast<std::ptrdiff_t>(i));
                slope(l, t.factor[i]) += evaluate({rest}, ekf.value);
            }
        }
    }
    const Sized G = linear_part(F, 0, n_), V = linear_part(F, 2 * n_, p_);
    const Matrix left = Pe.value - L.value * S.value(Eigen::all, Eigen::all) * L.value.transpose();
    const Matrix moved = slope.cwiseAbs() * Pe.value.cwiseAbs() * slope.cwiseAbs().transpose();
    const Sized joseph = G * exact_Pe * transposed(G) + V * diagonal(R) * transposed(V) + diagonal(Q);
    Pe = {slope * left * slope.transpose() + Matrix(Q.asDiagonal()), joseph.size + moved};
}

/* Coefficients of all rows, of each monomial of the noise over [1; X]; above mu what is cut off. */
void PolynomialFilter::split(const std::vector<Series> &rows)
{
    const auto count = static_cast<Eigen::Index>(rows.size()), wide = static_cast<Eigen::Index>(X.size());
    by_noise_.assign(noises_.size(), Sized{Matrix::Zero(count, wide), Matrix::Zero(count, wide)});
    cut_ = {Matrix::Zero(count, static_cast<Eigen::Index>(ring_.size())), Matrix::Zero(count, static_cast<Eigen::Index>(ring_.size()))};
    for (Eigen::Index a = 0; a < count; ++a) {
        const Series &row = rows[static_cast<size_t>(a)];
        for (size_t k = 0; k < row.value.size(); ++k) {
            for (Eigen::Index at = 0; at < row.value[k].size(); ++at) {
                const int m = collected_[k][static_cast<size_t>(at)];
                cut_.value(a, m) += row.value[k](at);
                cut_.size(a, m) += row.size[k](at);
            }
        }
        for (size_t m = 0; m < ring_.size(); ++m) {
            if (ring_[m].size() <= static_cast<size_t>(mu_)) {
                const auto at = static_cast<Eigen::Index>(m);
                Sized &of = by_noise_[noise_at_[m]];
                of.value(a, state_at_[m]) = cut_.value(a, at);
                of.size(a, state_at_[m]) = cut_.size(a, at);
            }
        }
    }
}

/* N = sum of Cov(nu^b, nu^b') q_b M q_b' */
Sized PolynomialFilter::noise_covariance() const
{
    const Eigen::Index count = by_noise_.front().value.rows();
    Sized sum{Matrix::Zero(count, count), Matrix::Zero(count, count)};
    std::vector<Sized> weighed;
    for (const Sized &q : by_noise_) {
        weighed.push_back(exact(M.value) * transposed(q));
    }
    for (const Correlated &pair : correlated_) {
        const Sized product = by_noise_[pair.a] * weighed[pair.b];
        sum.value += pair.covariance * product.value;
        sum.size += std::abs(pair.covariance) * product.size;
    }
    return sum;
}

/* s^2 m, of m rows that cut something off (2.2, step 3): a monomial of mu + 1 states is its last times the others, else what it has of noise counts by its root of a mean square. */
Sized PolynomialFilter::remainders() const
{
    const Eigen::Index count = cut_.value.rows();
    Sized s{Matrix::Zero(count, 1), Matrix::Zero(count, 1)};
    for (size_t m = 0; m < ring_.size(); ++m) {
        if (ring_[m].size() > static_cast<size_t>(mu_)) {
            Tuple  states = parts_[m].first;
            double worth = root_[m];
            if (states.size() > static_cast<size_t>(mu_)) {
                const int l = states.back();
                states.pop_back();
                worth = std::min(levels_.reach * std::sqrt(std::max(P.value(l, l), 0.0)), levels_.box(l));
            }
            const int at = state_place_.at(states);
            worth *= std::sqrt(std::max(M.value(at, at), 0.0));
            s.value += worth * cut_.value.col(static_cast<Eigen::Index>(m)).cwiseAbs();
            s.size += worth * cut_.size.col(static_cast<Eigen::Index>(m));
        }
    }
    const auto cutting = static_cast<double>((s.value.array() > 0.0).count());
    return {cutting * s.value.cwiseAbs2(), 2.0 * cutting * s.value.cwiseProduct(s.size)};
}

Sized PolynomialFilter::join(const Sized &linear, Sized &N, double &bound, double &bound_size) const
{
    const Sized carried = linear * exact(P.value) * transposed(linear);
    bound = 1.0;
    bound_size = 0.0;
    if (!bounded_) {
        return carried + N;
    }
    const Sized slack = remainders(), whole = carried + N;
    const Eigen::Index rows = slack.value.size();
    double mean_share = 0.0, off = 0.0;
    for (Eigen::Index a = 0; a < rows; ++a) {
        const double w = whole.value(a, a);
        mean_share += (w > 0.0) ? slack.value(a) / (w * static_cast<double>(rows)) : 0.0;
        off = std::max(off, part(slack.size(a), slack.value(a)) + part(whole.size(a, a), w));
    }
    const double e = split_weight(mean_share);
    bound = 1.0 + e;
    bound_size = 0.5 * e * off;
    Sized J{bound * carried.value + N.value, bound * carried.size + N.size + bound_size * carried.value.cwiseAbs()};
    J.value.diagonal() += (1.0 + 1.0 / e) * slack.value;
    J.size.diagonal() += (1.0 + 1.0 / e) * slack.size + (bound_size / (e * e)) * slack.value;
    return J;
}

void PolynomialFilter::update(const Vector &radius, const Sized &whole, const Sized &J, double bound, double bound_size)
{
    const int N = static_cast<int>(X.size()) - 1, measured = static_cast<int>(Y.size());
    const Sized linear{whole.value.rightCols(N), whole.size.rightCols(N)};
    Sized  Yc{Matrix::Ones(measured, 1), Matrix::Zero(measured, 1)};
    Vector Delta(measured), Delta_size(measured);
    std::vector<int> used, judged;
    std::vector<bool> worth(static_cast<size_t>(p_));
    double trace = 0.0, square = 0.0, wide = 0.0;
    for (int j = 0; j < p_; ++j) {
        const double variance = J.value(N + j, N + j), r = radius(j);
        const bool fresh = r <= levels_.fresh(j);
        worth[static_cast<size_t>(j)] = fresh || (std::isfinite(r) && r * r < variance);
        tie = tie || (!fresh && std::isfinite(r) && std::abs(r * r - variance) < 1e-3 * variance);
        trace += std::isfinite(r) ? variance : 0.0;
        wide += (std::isfinite(r) && !fresh) ? r * r : 0.0;
    }
    double mean_share = 0.0, off = 0.0;
    int silent = 0;
    for (int k = 0; k < measured; ++k) {
        double most = 1.0, most_size = 0.0;
        bool use = true;
        for (int j : Y[static_cast<size_t>(k)]) {
            const double e = eta_.value(j), size = eta_.size(j), r = (radius(j) <= levels_.fresh(j) || !std::isfinite(radius(j))) ? 0.0 : radius(j);
            Yc.size(k) = std::abs(Yc.value(k)) * size + Yc.size(k) * std::abs(e);
            Yc.value(k) *= e;
            most_size = most * (size + r) + most_size * (std::abs(e) + r);
            most *= std::abs(e) + r;
            use = use && worth[static_cast<size_t>(j)];
        }
        Delta(k) = most - std::abs(Yc.value(k));
        Delta_size(k) = most_size + Yc.size(k);
        if (Delta(k) <= 0.0) {
            Delta_size(k) = 0.0;
        }
        if (use) {
            used.push_back(k);
            if (static_cast<int>(Y[static_cast<size_t>(k)].size()) <= 2) {
                judged.push_back(static_cast<int>(used.size()) - 1);
            }
            silent += (Delta(k) > 0.0) ? 1 : 0;
            mean_share += Delta(k) * Delta(k) / J.value(N + k, N + k);
            off = std::max(off, 2.0 * part(Delta_size(k), Delta(k)) + part(J.size(N + k, N + k), J.value(N + k, N + k)));
        }
    }
    const double d = (silent > 0) ? split_weight(mean_share * silent / static_cast<double>(used.size())) : 0.0, d_size = 0.5 * d * off;
    double wider = 1.0 + d;
    const Sized ahead = whole * exact(z.value);
    const Sized r{Yc.value - ahead.value.bottomRows(measured), Yc.size + ahead.size.bottomRows(measured)};
    for (int j = 0; j < p_; ++j) {
        square += std::isfinite(radius(j)) ? r.value(j) * r.value(j) : 0.0;
    }
    plain = std::sqrt(square);
    threshold = levels_.kappa * std::sqrt(trace) + std::sqrt(wide);
    std::vector<int> rows;
    for (int k : used) {
        rows.push_back(N + k);
    }
    const std::vector<int> states = counted(0, n_), lifted = counted(0, N);
    Sized K{Matrix::Zero(N, measured), Matrix::Zero(N, measured)}, Kf{Matrix::Zero(n_, measured), Matrix::Zero(n_, measured)};
    joint = exact(Matrix::Zero(1, 1));
    x = Sized{c.value, c.value.cwiseAbs()}; /* step() puts the point of expansion here */
    Sized Pn = chosen(exact(P.value), states, states), Jx = chosen(J, lifted, lifted);
    Sized taken{Matrix::Zero(N, N), Matrix::Zero(N, N)}, taken_f{Matrix::Zero(n_, n_), Matrix::Zero(n_, n_)};
    Sized move{Matrix::Zero(N, 1), Matrix::Zero(N, 1)}, move_f{Matrix::Zero(n_, 1), Matrix::Zero(n_, 1)};
    held = false;
    if (!used.empty()) {
        Sized S = chosen(J, rows, rows), Jxy = chosen(J, lifted, rows);
        S.size = wider * S.size + d_size * S.value.cwiseAbs();
        S.value *= wider;
        Jxy.size = wider * Jxy.size + d_size * Jxy.value.cwiseAbs();
        Jxy.value *= wider;
        for (size_t i = 0; i < used.size() && silent > 0; ++i) {
            const auto at = static_cast<Eigen::Index>(i);
            const double D = Delta(used[i]), D_size = Delta_size(used[i]);
            S.value(at, at) += (1.0 + 1.0 / d) * silent * D * D;
            S.size(at, at) += (1.0 + 1.0 / d) * silent * 2.0 * D * D_size + (d_size / (d * d)) * silent * D * D;
        }
        const std::vector<int> none{0};
        const Sized ru = chosen(r, used, none);
        const Sized carried = exact(P.value) * transposed(chosen(linear, rows, lifted));
        Sized Pxy = chosen(carried, states, counted(0, static_cast<int>(used.size())));
        const double scale = wider * bound, scale_size = d_size * bound + wider * bound_size;
        Pxy.size = scale * Pxy.size + scale_size * Pxy.value.cwiseAbs();
        Pxy.value *= scale;
        K = divided(Jxy, S);
        Kf = divided(Pxy, S);
        const Sized rt = transposed(ru);
        const Sized rj = chosen(rt, none, judged), Sj = chosen(S, judged, judged);
        joint = divided(rj, Sj) * transposed(rj);
        taken = K * transposed(Jxy);
        taken_f = Kf * transposed(Pxy);
        move = K * ru;
        move_f = Kf * ru;
        const Vector after = scale * Pn.value.diagonal() - taken_f.value.diagonal();
        const double left = after.cwiseQuotient(bound * Pn.value.diagonal()).sum();
        held = wider > 1.0 && left >= n_;
        tie = tie || (wider > 1.0 && std::abs(left - n_) < 1e-3 * n_);
        if (held) {
            wider = 1.0;
            for (Sized *s : {&taken, &taken_f, &move, &move_f}) {
                s->value.setZero();
                s->size.setZero();
            }
        }
    } else {
        wider = 1.0;
    }
    const double scale = wider * bound, scale_size = d_size * bound + wider * bound_size;
    x = x + Sized{z.value.middleRows(1, n_), z.value.middleRows(1, n_).cwiseAbs()} + move_f;
    Px = {scale * Pn.value - taken_f.value, scale * Pn.size + scale_size * Pn.value.cwiseAbs() + taken_f.size};
    z.value.bottomRows(N) = ahead.value.topRows(N) + move.value;
    z.size.bottomRows(N) = ahead.size.topRows(N) + move.size;
    P = {wider * Jx.value - taken.value, wider * Jx.size + d_size * Jx.value.cwiseAbs() + taken.size};
}

void PolynomialFilter::step(const Vector &y, const Vector &radius)
{
    tie = false;
    const Sized before = exact(c.value);
    std::vector<Series> H, F, rows;
    auxiliary(y, radius, H, F);
    const Sized next = c;
    for (size_t a = 1; a < X.size(); ++a) {
        Series product = F[static_cast<size_t>(X[a][0])];
        for (size_t i = 1; i < X[a].size(); ++i) {
            product = product * F[static_cast<size_t>(X[a][i])];
        }
        rows.push_back(product);
    }
    for (const Tuple &t : Y) {
        Series product = H[static_cast<size_t>(t[0])];
        for (size_t i = 1; i < t.size(); ++i) {
            product = product * H[static_cast<size_t>(t[i])];
        }
        rows.push_back(product);
    }
    split(rows);
    const auto count = static_cast<Eigen::Index>(rows.size());
    const Eigen::Index wide = M.value.rows(), N = wide - 1;
    Sized linear{Matrix::Zero(count, wide), Matrix::Zero(count, wide)};
    for (size_t b = 0; b < noises_.size(); ++b) {
        linear.value += noise_mean_[b] * by_noise_[b].value;
        linear.size += std::abs(noise_mean_[b]) * by_noise_[b].size;
    }
    Sized covariance = noise_covariance();
    const Sized states{linear.value.rightCols(N), linear.size.rightCols(N)};
    double bound = 1.0, bound_size = 0.0;
    const Sized J = join(states, covariance, bound, bound_size);
    const Sized upper{linear.value.topRows(N), linear.size.topRows(N)};
    const Sized carried = upper * exact(M.value) * transposed(upper), first = upper * exact(M.value.col(0));
    Sized moved = exact(Matrix::Ones(wide, wide));
    moved.value.bottomRightCorner(N, N) = carried.value + covariance.value.topLeftCorner(N, N);
    moved.size.bottomRightCorner(N, N) = carried.size + covariance.size.topLeftCorner(N, N);
    moved.value.block(1, 0, N, 1) = first.value;
    moved.size.block(1, 0, N, 1) = first.size;
    moved.value.block(0, 1, 1, N) = first.value.transpose();
    moved.size.block(0, 1, 1, N) = first.size.transpose();
    c = before;
    update(radius, linear, J, bound, bound_size);
    c = next;
    M = moved;
}

} // namespace oracle
