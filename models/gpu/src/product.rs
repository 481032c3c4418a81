//! Kernel for all matrix products: tiles in shared memory, a block of each tile in a unit's registers.

use cubecl::client::Client;
use cubecl::prelude::*;

use crate::device::{Buffer, buffer};
use crate::matrix::{Layout, Matrix, Store, Transposed};
use crate::networks::{Place, begin};

/// Maximum number of cubes along one axis of a launch on any GPU.
const AXIS: usize = 65_535;

/// Number of values in a vector.
const FOUR: usize = 4;
type Quad = Vector<f32, Const<4>>;

/// Depth of a tile.
const DEPTH: usize = 16;
/// Number of rows, and of columns, of a tile that one unit computes.
const UNIT: usize = FOUR;

/// Sizes of a tile.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) struct Tile {
    rows: usize,
    columns: usize,
}

impl Tile {
    const fn units(&self) -> usize {
        self.rows / UNIT * (self.columns / UNIT)
    }

    /// Chooses a tile by the number of rows.
    ///
    /// Of thirteen tiles from 16 x 128 to 128 x 128, with unit blocks from 4 x 4 to 8 x 8, with and without prefetching, these were the
    /// fastest or within a tenth of the fastest for every product of TactNet-II on an H200.
    fn of(rows: usize) -> Self {
        let (rows, columns) = if rows <= 16 { (16, 128) } else { (64, 64) };
        Self { rows, columns }
    }
}

/// One factor of a product.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) struct Side {
    layout: Layout,
    /// True if neighbours along the depth are adjacent in memory, false if neighbours along rows or columns are.
    along_depth: bool,
    place: Place,
}

impl Side {
    /// Creates a factor, shared by all networks, whose neighbours along the depth are adjacent in memory.
    pub(crate) fn along_depth(layout: Layout) -> Self {
        Self {
            layout,
            along_depth: true,
            place: Place::default(),
        }
    }

    /// Creates a factor, shared by all networks, whose neighbours along rows or columns are adjacent in memory.
    pub(crate) fn across(layout: Layout) -> Self {
        Self {
            layout,
            along_depth: false,
            place: Place::default(),
        }
    }

    /// Sets the location of each network's matrix.
    pub(crate) fn of(self, place: Place) -> Self {
        Self { place, ..self }
    }
}

/// Sizes of a product and of its factors' rules.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) struct Problem {
    rows: usize,
    depth: usize,
    columns: usize,
    left: Side,
    right: Side,
    networks: usize,
    members: usize,
    parts: usize,
    out: Layout,
    out_place: Place,
}

impl Problem {
    /// Creates the product `[rows][depth]` by `[depth][columns]` with a row-major result.
    pub(crate) fn of([rows, depth, columns]: [usize; 3], left: Side, right: Side) -> Self {
        Self {
            rows,
            depth,
            columns,
            left,
            right,
            networks: 1,
            members: 1,
            parts: 1,
            out: Layout::in_order(rows, columns),
            out_place: Place::default(),
        }
    }

    /// Sets the number of matrices.
    pub(crate) fn members(self, members: usize) -> Self {
        Self { members, ..self }
    }

    /// Sets the number of networks and the location of their results.
    pub(crate) fn networks(self, networks: usize, out: Place) -> Self {
        Self {
            networks,
            out_place: out,
            ..self
        }
    }

    /// Divides the depth into `parts`, whose sums are separate members of the result.
    pub(crate) fn parts(self, parts: usize) -> Self {
        Self { parts, ..self }
    }

    /// Sets the layout of the result for a storage rule.
    pub(crate) fn into(self, out: Layout) -> Self {
        Self { out, ..self }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
struct Plan {
    problem: Problem,
    tile: Tile,
    grid_x: usize,
    tiles: usize,
    column_tiles: usize,
    part: usize,
}

/// Multiplies `left` `[rows][depth]` by `right` `[depth][columns]` to `out`, for every member of every network.
pub(crate) fn product<L: Matrix, R: Matrix, S: Store>(
    client: &Client,
    problem: Problem,
    left: &Buffer,
    right: &Buffer,
    out: &Buffer,
) {
    let tile = Tile::of(problem.rows);
    let column_tiles = problem.columns.div_ceil(tile.columns);
    let tiles = problem.rows.div_ceil(tile.rows) * column_tiles;
    let grid_x = tiles.min(AXIS);
    let plan = Plan {
        // The compiled kernel does not depend on the number of networks.
        problem: Problem {
            networks: 1,
            ..problem
        },
        tile,
        grid_x,
        tiles,
        column_tiles,
        part: problem
            .depth
            .div_ceil(problem.parts)
            .next_multiple_of(DEPTH),
    };
    let count = CubeCount::Static(
        grid_x as u32,
        tiles.div_ceil(grid_x) as u32,
        (problem.networks * problem.members * problem.parts) as u32,
    );
    // SAFETY: lengths are those of the buffers; the bounds of the rules and of the tile limit every access.
    unsafe {
        multiply::launch_unchecked::<L, R, S>(
            client,
            count,
            CubeDim::new_1d(tile.units() as u32),
            buffer(left),
            buffer(right),
            buffer(out),
            plan,
        );
    }
}

#[cube(launch_unchecked)]
fn multiply<L: Matrix, R: Matrix, S: Store>(
    left: &[f32],
    right: &[f32],
    out: &mut [f32],
    #[comptime] plan: Plan,
) {
    let p = comptime!(plan.problem);
    let t = comptime!(plan.tile);
    let units = comptime!(t.units());
    // Tiles hold vectors of four rows or columns. One extra vector per line puts units on different memory banks.
    let (rows, columns) = comptime!((t.rows / FOUR, t.columns / FOUR));
    let (pitch_l, pitch_r) = comptime!((rows + 1, columns + 1));
    let (loads_l, loads_r) = comptime!((
        (rows * DEPTH).div_ceil(units),
        (columns * DEPTH).div_ceil(units)
    ));
    let mut tile_l = Shared::<[Quad]>::new_slice(comptime!(DEPTH * pitch_l));
    let mut tile_r = Shared::<[Quad]>::new_slice(comptime!(DEPTH * pitch_r));
    let mut sums = Array::<Quad>::new(UNIT);

    let tile = CUBE_POS_Y as usize * plan.grid_x + CUBE_POS_X as usize;
    if tile >= plan.tiles {
        terminate!();
    }
    let first_row = tile / plan.column_tiles * t.rows;
    let first_column = tile % plan.column_tiles * t.columns;
    let own = comptime!(p.members * p.parts);
    let network = CUBE_POS_Z as usize / own;
    let z = CUBE_POS_Z as usize % own;
    let from_left = begin(network, p.left.place);
    let from_right = begin(network, p.right.place);
    let member = z / p.parts;
    let first_depth = z % p.parts * plan.part;
    let end = (first_depth + plan.part).min(p.depth);
    let unit = UNIT_POS as usize;
    let unit_column = unit % columns;
    let unit_row = unit / columns;

    #[unroll]
    for i in 0..UNIT {
        sums[i] = Quad::new(0.0f32);
    }

    let mut at = first_depth;
    while at < end {
        #[unroll]
        for i in 0..loads_l {
            let e = unit + i * units;
            let (k, row) = split(e, rows, p.left.along_depth);
            if comptime!((i + 1) * units <= rows * DEPTH) || e < comptime!(rows * DEPTH) {
                let first = first_row + row * FOUR;
                tile_l[k * pitch_l + row] = four_of::<L>(
                    left,
                    from_left,
                    member,
                    first,
                    at + k,
                    end,
                    p.rows,
                    p.left.layout,
                );
            }
        }
        #[unroll]
        for i in 0..loads_r {
            let e = unit + i * units;
            let (k, column) = split(e, columns, p.right.along_depth);
            if comptime!((i + 1) * units <= columns * DEPTH) || e < comptime!(columns * DEPTH) {
                let first = first_column + column * FOUR;
                tile_r[k * pitch_r + column] = four_of::<Transposed<R>>(
                    right,
                    from_right,
                    member,
                    first,
                    at + k,
                    end,
                    p.columns,
                    p.right.layout,
                );
            }
        }
        sync_cube();
        for k in 0..DEPTH {
            let from_l = tile_l[k * pitch_l + unit_row];
            let from_r = tile_r[k * pitch_r + unit_column];
            #[unroll]
            for i in 0..UNIT {
                sums[i] += Quad::new(from_l.extract(i)) * from_r;
            }
        }
        sync_cube();
        at += DEPTH;
    }

    let into = begin(network, p.out_place);
    #[unroll]
    for i in 0..UNIT {
        let row = first_row + unit_row * UNIT + i;
        #[unroll]
        for j in 0..UNIT {
            let column = first_column + unit_column * UNIT + j;
            if row < p.rows && column < p.columns {
                let value = sums[i].extract(j);
                S::put(out, into, z, row, column, value, p.out);
            }
        }
    }
}

/// Returns four rows of one column, zeros beyond the last row and column.
#[cube]
fn four_of<M: Matrix>(
    data: &[f32],
    from: usize,
    member: usize,
    row: usize,
    column: usize,
    last_column: usize,
    #[comptime] rows: usize,
    #[comptime] layout: Layout,
) -> Quad {
    let mut quad = Quad::new(0.0f32);
    if column < last_column {
        #[unroll]
        for j in 0..FOUR {
            if row + j < rows {
                quad.insert(j, M::at(data, from, member, row + j, column, layout));
            }
        }
    }
    quad
}

/// Returns entry `e` of a tile as `(depth, other index)`.
#[cube]
fn split(e: usize, #[comptime] others: usize, #[comptime] along_depth: bool) -> (usize, usize) {
    if along_depth {
        (e % DEPTH, e / DEPTH)
    } else {
        (e / others, e % others)
    }
}
