//! The scene on the device: geometry, textures, placed instances and the lights' table, each sent only when it changed.

use std::collections::BTreeMap;
use std::sync::Arc;

use half::f16;

use super::arena::Arena;
use crate::error::{Error, Result};
use crate::gpu::{Buffer, Gpu, Usage};
use crate::scene::material::Texture;
use crate::scene::mesh::Mesh;
use crate::scene::prepare::{InstanceRecord, LIGHT_ROWS, Prepared, RADIANCE_ROW};

/// Device copies of a scene's parts.
#[derive(Debug)]
pub struct SceneBuffers {
    geometry: Arena<u32>,
    texels: Arena<[u32; 2]>,
    records: Vec<InstanceRecord>,
    instances: Option<Buffer<InstanceRecord>>,
    lobe_rows: Vec<[f32; 4]>,
    lobes: Option<Buffer<[f32; 4]>>,
    light_rows: Vec<[f32; 4]>,
    light_textures: Vec<u64>,
    lights: Option<Buffer<[f32; 4]>>,
    /// Of lights with a picture, where a surface has a lobe: the picture's number, and its sums.
    light_sums: BTreeMap<usize, (u64, Buffer<[f32; 4]>)>,
}

/// Rows that the lights' table can name.
const MOST_LIGHT_ROWS: usize = 1 << 24;

/// Words of a mesh in the arena: triangles, positions, then the attributes that it has.
fn mesh_words(mesh: &Mesh) -> usize {
    let attribute = |there: bool, n: usize| if there { n * mesh.positions.len() } else { 0 };
    3 * mesh.triangles.len()
        + 3 * mesh.positions.len()
        + attribute(mesh.normals.is_some(), 3)
        + attribute(mesh.uvs.is_some(), 2)
        + attribute(mesh.colors.is_some(), 3)
}

fn pack_mesh(mesh: &Mesh) -> Vec<u32> {
    let mut words: Vec<u32> = Vec::with_capacity(mesh_words(mesh));
    words.extend_from_slice(bytemuck::cast_slice(&mesh.triangles));
    words.extend_from_slice(bytemuck::cast_slice(&mesh.positions));
    // In the order of the offsets in `sync_instances`.
    for values in [
        mesh.normals.as_deref().map(bytemuck::cast_slice),
        mesh.uvs.as_deref().map(bytemuck::cast_slice),
        mesh.colors.as_deref().map(bytemuck::cast_slice),
    ]
    .into_iter()
    .flatten()
    {
        words.extend_from_slice(values);
    }
    words
}

/// Half floats: albedo lies in [0, 1], where they are good to 0.05 %.
fn pack_texture(texture: &Texture) -> Vec<[u32; 2]> {
    let bits = |x: f32| u32::from(f16::from_f32(x).to_bits());
    texture.texels.iter().map(|[r, g, b]| [bits(*r) | bits(*g) << 16, bits(*b)]).collect()
}

impl SceneBuffers {
    /// Nothing on the device yet.
    pub fn new() -> Self {
        Self {
            geometry: Arena::new("geometry", "the scene's vertices and triangles"),
            texels: Arena::new("texels", "the scene's base-colour textures"),
            records: Vec::new(),
            instances: None,
            lobe_rows: Vec::new(),
            lobes: None,
            light_rows: Vec::new(),
            light_textures: Vec::new(),
            lights: None,
            light_sums: BTreeMap::new(),
        }
    }

    /// Brings the device up to date; returns the names of what was sent.
    ///
    /// # Errors
    /// `Device` when a part does not fit into one binding of the adapter.
    pub fn sync(&mut self, gpu: &Gpu, scene: &Prepared) -> Result<Vec<&'static str>> {
        let mut sent = Vec::new();
        let meshes: BTreeMap<u64, &Arc<Mesh>> = scene.placed.iter().map(|p| (p.mesh.id, &p.mesh)).collect();
        let wanted: Vec<(u64, usize)> = meshes.iter().map(|(id, mesh)| (*id, mesh_words(mesh))).collect();
        if self.geometry.sync(gpu, &wanted, |id| pack_mesh(meshes[&id]))? {
            sent.push("geometry");
        }
        let textures: BTreeMap<u64, &Arc<Texture>> =
            scene.placed.iter().filter_map(|p| p.texture.as_ref()).map(|t| (t.id, t)).collect();
        let wanted: Vec<(u64, usize)> = textures.iter().map(|(id, t)| (*id, t.texels.len())).collect();
        if self.texels.sync(gpu, &wanted, |id| pack_texture(textures[&id]))? && !wanted.is_empty() {
            sent.push("textures");
        }
        if self.sync_instances(gpu, scene)? {
            sent.push("instances");
        }
        if self.sync_lobes(gpu, scene)? {
            sent.push("lobes");
        }
        if self.sync_lights(gpu, scene)? {
            sent.push("lights");
        }
        self.sync_sums(gpu, scene)?;
        Ok(sent)
    }

    fn sync_instances(&mut self, gpu: &Gpu, scene: &Prepared) -> Result<bool> {
        let records: Vec<InstanceRecord> = scene
            .placed
            .iter()
            .map(|placed| {
                let mut record = placed.record;
                let mesh = &placed.mesh;
                let vertices = mesh.positions.len() as u32;
                record.triangles = self.geometry.first(mesh.id);
                record.positions = record.triangles + 3 * mesh.triangles.len() as u32;
                record.normals = record.positions + 3 * vertices;
                record.uvs = record.normals + if mesh.normals.is_some() { 3 * vertices } else { 0 };
                record.colors = record.uvs + if mesh.uvs.is_some() { 2 * vertices } else { 0 };
                if let Some(texture) = &placed.texture {
                    record.texture = self.texels.first(texture.id);
                    (record.texture_width, record.texture_height) = (texture.width, texture.height);
                }
                record
            })
            .collect();
        if records == self.records && self.instances.is_some() {
            return Ok(false);
        }
        send(gpu, "instances", &mut self.instances, &records)?;
        self.records = records;
        Ok(true)
    }

    /// A scene without a lobe has none on the device.
    fn sync_lobes(&mut self, gpu: &Gpu, scene: &Prepared) -> Result<bool> {
        let rows: Vec<[f32; 4]> = scene.placed.iter().map(|placed| placed.lobe).collect();
        if rows.iter().all(|row| row[..3] == [0.0; 3]) {
            (self.lobe_rows, self.lobes) = (Vec::new(), None);
            return Ok(false);
        }
        if rows == self.lobe_rows {
            return Ok(false);
        }
        send(gpu, "instance_lobes", &mut self.lobes, &rows)?;
        self.lobe_rows = rows;
        Ok(true)
    }

    /// Written in place where the size is the same; only a scene with lobes needs them.
    fn sync_sums(&mut self, gpu: &Gpu, scene: &Prepared) -> Result<()> {
        let wanted = |light: &usize| self.lobes.is_some() && scene.light_textures.contains_key(light);
        self.light_sums.retain(|light, _| wanted(light));
        for (&light, texture) in scene.light_textures.iter().filter(|_| self.lobes.is_some()) {
            if self.light_sums.get(&light).is_some_and(|(id, _)| *id == texture.id) {
                continue;
            }
            let mut buffer = self.light_sums.remove(&light).map(|(_, buffer)| buffer);
            send(gpu, "light_sums", &mut buffer, &texture.sums())?;
            if let Some(buffer) = buffer {
                self.light_sums.insert(light, (texture.id, buffer));
            }
        }
        Ok(())
    }

    /// Sums over the picture of a light, see [`Texture::sums`].
    pub fn light_sums(&self, light: usize) -> Option<&Buffer<[f32; 4]>> {
        self.light_sums.get(&light).map(|(_, buffer)| buffer)
    }

    /// Radiance and texels are written in place, which is no rebuild; `true` when the table was made anew or a light
    /// moved.
    fn sync_lights(&mut self, gpu: &Gpu, scene: &Prepared) -> Result<bool> {
        let ids: Vec<u64> = scene.light_textures.values().map(|t| t.id).collect();
        if scene.light_rows == self.light_rows && ids == self.light_textures && self.lights.is_some() {
            return Ok(false);
        }
        let mut table = scene.light_rows.clone();
        for texture in scene.light_textures.values() {
            table.extend(texture.texels.iter().map(|[r, g, b]| [*r, *g, *b, 0.0]));
        }
        // The table names its rows by float32, which counts that far.
        if table.len() > MOST_LIGHT_ROWS {
            return Err(Error::Device(format!(
                "the lights and their pictures have {} texels and rows; at most {MOST_LIGHT_ROWS} fit",
                table.len()
            )));
        }
        let in_place = self.lights.as_ref().is_some_and(|b| b.len() == table.len());
        let rebuilt = !in_place || !same_places(&scene.light_rows, &self.light_rows);
        send(gpu, "lights", &mut self.lights, &table)?;
        self.light_rows.clone_from(&scene.light_rows);
        self.light_textures = ids;
        Ok(rebuilt)
    }

    /// Vertices and triangles.
    pub fn geometry(&self) -> Result<&Buffer<u32>> {
        self.geometry.buffer()
    }

    /// Base-colour texels.
    pub fn texels(&self) -> Result<&Buffer<[u32; 2]>> {
        self.texels.buffer()
    }

    /// Placed meshes and visible lights.
    pub fn instances(&self) -> Result<&Buffer<InstanceRecord>> {
        self.instances.as_ref().ok_or_else(|| Error::Device("the instances were never sent".to_owned()))
    }

    /// Specular reflectance and exponent of each instance.
    pub fn lobes(&self) -> Result<&Buffer<[f32; 4]>> {
        self.lobes.as_ref().ok_or_else(|| Error::Device("no instance has a lobe".to_owned()))
    }

    /// The lights' table.
    pub fn lights(&self) -> Result<&Buffer<[f32; 4]>> {
        self.lights.as_ref().ok_or_else(|| Error::Device("the lights were never sent".to_owned()))
    }
}

impl Default for SceneBuffers {
    fn default() -> Self {
        Self::new()
    }
}

/// Whether two tables differ in radiance alone.
fn same_places(a: &[[f32; 4]], b: &[[f32; 4]]) -> bool {
    let same = |(i, (a, b)): (usize, (&[f32; 4], &[f32; 4]))| i % LIGHT_ROWS == RADIANCE_ROW || a == b;
    a.len() == b.len() && a.iter().zip(b).enumerate().all(same)
}

/// Writes `data` into the buffer, in place where it fits exactly as it is.
fn send<T: bytemuck::Pod>(gpu: &Gpu, label: &str, buffer: &mut Option<Buffer<T>>, data: &[T]) -> Result<()> {
    if let Some(kept) = buffer.as_ref().filter(|b| b.len() == data.len()) {
        return kept.write(gpu, 0, data);
    }
    let limit = gpu.limits().max_storage_buffer_binding_size;
    let bytes = size_of_val(data) as u64;
    if bytes > limit {
        return Err(Error::Device(format!(
            "the {label} need {bytes} bytes in one binding; this adapter allows {limit} (max_storage_buffer_binding_size)"
        )));
    }
    *buffer = None;
    let made = gpu.buffer(label, data.len(), Usage::Storage)?;
    made.write(gpu, 0, data)?;
    *buffer = Some(made);
    Ok(())
}
