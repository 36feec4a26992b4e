// Stands for Unity's graphics: nothing is drawn, what was asked for is remembered. API.md: pages and versions.
using System;
using System.Collections.Generic;
using UnityEngine.Rendering;

namespace UnityEngine
{
    public enum MeshTopology { Triangles }
    public enum ColorSpace { Gamma, Linear }

    public sealed partial class Shader : Object
    {
        static readonly List<string> Names = new List<string>();
        public static int PropertyToID(string name)
        {
            int id = Names.IndexOf(name);
            if (id >= 0) return id;
            Names.Add(name);
            return Names.Count - 1;
        }
        internal static string NameOf(int id) { return Names[id]; }
    }

    public sealed partial class Material : Object
    {
        public Material(Shader shader) { Made.Add(this); }
    }

    public sealed class GraphicsBuffer : IDisposable
    {
        public enum Target { Structured = 16, Index = 2 }
        internal static int Alive;
        internal readonly uint[] Words;
        public int count { get; private set; }
        public GraphicsBuffer(Target target, int count, int stride)
        {
            if (count <= 0 || stride <= 0 || stride % 4 != 0) throw new ArgumentException("a buffer of " + count + " x " + stride + " bytes");
            this.count = count;
            Words = new uint[count * stride / 4];
            Alive++;
        }
        public void SetData(Array data)
        {
            if (Player.OnUpload != null) Player.OnUpload();
            if (data is Vector4[])
            {
                var rows = (Vector4[])data;
                for (int i = 0; i < rows.Length; i++)
                {
                    Words[i * 4] = Bits(rows[i].x);
                    Words[i * 4 + 1] = Bits(rows[i].y);
                    Words[i * 4 + 2] = Bits(rows[i].z);
                    Words[i * 4 + 3] = Bits(rows[i].w);
                }
            }
            else Buffer.BlockCopy(data, 0, Words, 0, data.Length * 4);
        }
        static uint Bits(float x)
        {
            return new FloatBits { Real = x }.Whole;
        }
        [System.Runtime.InteropServices.StructLayout(System.Runtime.InteropServices.LayoutKind.Explicit)]
        struct FloatBits
        {
            [System.Runtime.InteropServices.FieldOffset(0)] public float Real;
            [System.Runtime.InteropServices.FieldOffset(0)] public uint Whole;
        }
        public void Dispose() { Alive--; }
    }

    public enum RenderTextureFormat { ARGBHalf = 2, RHalf = 15 }
    public enum RenderTextureReadWrite { Linear = 1 }

    public static class GL
    {
        public static Matrix4x4 GetGPUProjectionMatrix(Matrix4x4 proj, bool renderIntoTexture)
        {
            if (!renderIntoTexture) throw new NotImplementedException();
            proj.m10 = -proj.m10;
            proj.m11 = -proj.m11;
            proj.m12 = -proj.m12;
            proj.m13 = -proj.m13;
            return proj;
        }
    }

    public sealed class ComputeShader : Object
    {
        internal static readonly string[] Kernels = { "Skin", "Bind", "SortBlocks", "SortAcross", "SortMerge", "Correct", "Join" };
        // by property, and by property and kernel
        internal readonly Vector4[] Values = new Vector4[96];
        internal readonly GraphicsBuffer[,] Buffers = new GraphicsBuffer[Kernels.Length, 96];
        public int FindKernel(string name)
        {
            int kernel = Array.IndexOf(Kernels, name);
            if (kernel < 0) throw new ArgumentException(name);
            return kernel;
        }
        public void SetInt(int nameID, int val) { Values[nameID] = new Vector4(val, 0, 0, 0); }
        public void SetVector(int nameID, Vector4 val) { Values[nameID] = val; }
        public void SetBuffer(int kernelIndex, int nameID, GraphicsBuffer buffer) { Buffers[kernelIndex, nameID] = buffer; }
        public void Dispatch(int kernelIndex, int x, int y, int z) { if (Player.OnDispatch != null) Player.OnDispatch(this, kernelIndex, x); }
    }

    public sealed class MaterialPropertyBlock
    {
        internal readonly Vector4[] Values = new Vector4[96];
        internal readonly GraphicsBuffer[] Buffers = new GraphicsBuffer[96];
        internal readonly Matrix4x4[] Matrices = new Matrix4x4[96];
        internal readonly Texture[] Textures = new Texture[96];
        internal readonly Vector4[][] Arrays = new Vector4[96][];
        public void SetVectorArray(int nameID, Vector4[] values) { Arrays[nameID] = (Vector4[])values.Clone(); }
        public void SetVector(int nameID, Vector4 value) { Values[nameID] = value; }
        public void SetMatrix(int nameID, Matrix4x4 value) { Matrices[nameID] = value; }
        public void SetTexture(int nameID, Texture value) { Textures[nameID] = value; }
        public void SetInteger(int nameID, int value) { Values[nameID] = new Vector4(value, 0, 0, 0); }
        public void SetBuffer(int nameID, GraphicsBuffer value) { Buffers[nameID] = value; }
    }

    public struct RenderParams
    {
        public RenderParams(Material mat) : this() { material = mat; }
        public Material material { get; set; }
        public Camera camera { get; set; }
        public Bounds worldBounds { get; set; }
        public MaterialPropertyBlock matProps { get; set; }
        public int layer { get; set; }
        public ShadowCastingMode shadowCastingMode { get; set; }
        public bool receiveShadows { get; set; }
    }

    public static partial class Graphics
    {
        public static void RenderPrimitivesIndexed(in RenderParams rparams, MeshTopology topology, GraphicsBuffer indexBuffer, int indexCount,
                                                   int startIndex = 0, int instanceCount = 1)
        {
            if (Player.OnDraw != null) Player.OnDraw(rparams, indexBuffer, indexCount);
        }
        public static void ExecuteCommandBuffer(CommandBuffer buffer)
        {
            Player.OwnViewport = buffer.Viewport;
            if (Player.OnOwnDraw != null) Player.OnOwnDraw(buffer.Properties, buffer.Count);
        }
    }

    public enum CameraType { Game = 1, SceneView = 2, Preview = 4, VR = 8, Reflection = 16 }

    public sealed partial class Camera : Behaviour
    {
        internal static readonly List<Camera> All = new List<Camera>();
        public delegate void CameraCallback(Camera cam);
        public static CameraCallback onPreCull;
        public CameraType cameraType { get; set; } = CameraType.Game;
        public enum StereoscopicEye { Left, Right }
        internal float[] EyeFocal;
        public int cullingMask { get; set; } = -1;
        public int pixelHeight { get; internal set; } = 1080;
        public int pixelWidth { get { return 1920; } }
        public Rect rect { get; internal set; } = new Rect(0, 0, 1, 1);
        public bool stereoEnabled { get { return EyeFocal != null; } }
        public Matrix4x4 projectionMatrix { get; set; } = Lens(1, 1.7320508f);
        public Matrix4x4 worldToCameraMatrix { get { return ViewAt(0); } }
        public Matrix4x4 GetStereoViewMatrix(StereoscopicEye eye) { return ViewAt(eye == StereoscopicEye.Left ? 0.032f : -0.032f); }
        public Matrix4x4 GetStereoProjectionMatrix(StereoscopicEye eye) { return Lens(1, EyeFocal[(int)eye]); }
        internal static Matrix4x4 Lens(float x, float y) { return new Matrix4x4 { m00 = x, m11 = y, m22 = -1, m23 = -0.02f, m32 = -1 }; }
        public void Render()
        {
            if (Player.HasPipeline) Rendering.RenderPipelineManager.Begin(this);
            else if (onPreCull != null) onPreCull(this);
            if (Player.OnRender != null) Player.OnRender(this);
        }
        Matrix4x4 ViewAt(float side)
        {
            Matrix4x4 m = transform.worldToLocalMatrix;
            m.m03 += side;
            m.m20 = -m.m20;
            m.m21 = -m.m21;
            m.m22 = -m.m22;
            m.m23 = -m.m23;
            return m;
        }
    }

    public struct BoneWeight
    {
        public int boneIndex0 { get; set; }
        public int boneIndex1 { get; set; }
        public int boneIndex2 { get; set; }
        public int boneIndex3 { get; set; }
        public float weight0 { get; set; }
        public float weight1 { get; set; }
        public float weight2 { get; set; }
        public float weight3 { get; set; }
    }

    public sealed partial class Mesh : Object
    {
        public IndexFormat indexFormat { get; set; }
        public Vector3[] vertices { get; set; }
        public int[] triangles { get; set; }
        public BoneWeight[] boneWeights { get; set; }
        public Matrix4x4[] bindposes { get; set; }
        internal readonly List<KeyValuePair<string, Vector3[]>> Shapes = new List<KeyValuePair<string, Vector3[]>>();
        public int blendShapeCount { get { return Shapes.Count; } }
        public void AddBlendShapeFrame(string shapeName, float frameWeight, Vector3[] deltaVertices, Vector3[] deltaNormals, Vector3[] deltaTangents)
        {
            if (frameWeight != 100 || deltaVertices.Length != vertices.Length || deltaNormals != null || deltaTangents != null) throw new ArgumentException(shapeName);
            Shapes.Add(new KeyValuePair<string, Vector3[]>(shapeName, (Vector3[])deltaVertices.Clone()));
        }
        public int GetBlendShapeIndex(string blendShapeName) { return Shapes.FindIndex(shape => shape.Key == blendShapeName); }
        public void RecalculateNormals() { }
        public void RecalculateBounds() { }
    }

    public class Renderer : Component
    {
        public bool enabled { get; set; } = true;
        public ShadowCastingMode shadowCastingMode { get; set; }
        Material[] materials = { null };
        public Material sharedMaterial { get { return materials.Length == 0 ? null : materials[0]; } set { materials = new[] { value }; } }
        public Material[] sharedMaterials { get { return (Material[])materials.Clone(); } set { materials = (Material[])value.Clone(); } }
    }

    public sealed class SkinnedMeshRenderer : Renderer
    {
        public Mesh sharedMesh { get; set; }
        public Transform[] bones { get; set; }
        public Transform rootBone { get; set; }
        public Bounds localBounds { get; set; }
        internal readonly Dictionary<int, float> Weights = new Dictionary<int, float>();
        public float GetBlendShapeWeight(int index)
        {
            Check(index);
            float weight;
            return Weights.TryGetValue(index, out weight) ? weight : 0;
        }
        public void SetBlendShapeWeight(int index, float value)
        {
            Check(index);
            Weights[index] = value;
        }
        void Check(int index)
        {
            if (index < 0 || index >= sharedMesh.blendShapeCount) throw new ArgumentOutOfRangeException(index.ToString());
        }
    }

    public static partial class QualitySettings
    {
        public static int vSyncCount { get; set; }
        public static ColorSpace activeColorSpace { get { return ColorSpace.Linear; } }
    }

    public static class Screen
    {
        public static int width { get { return 640; } }
        public static int height { get { return 480; } }
    }

    public static class SystemInfo
    {
        public static bool supportsComputeShaders { get; internal set; } = true;
        public static int supportedRenderTargetCount { get { return 8; } }
        public static bool SupportsRenderTextureFormat(RenderTextureFormat format) { return Player.HasHalfTargets; }
        public static int maxComputeBufferInputsVertex { get { return 8; } }
        public static GraphicsDeviceType graphicsDeviceType { get { return GraphicsDeviceType.Vulkan; } }
        public static string graphicsDeviceName { get { return "stub \"GPU\""; } }
        public static string deviceModel { get { return "stub"; } }
        public static string processorType { get { return "stub"; } }
        public static string operatingSystem { get { return "stub"; } }
    }
}

namespace UnityEngine.Rendering
{
    public struct ScriptableRenderContext { }
    public abstract class RenderPipeline { }

    public static class RenderPipelineManager
    {
        public static RenderPipeline currentPipeline { get; internal set; }
        public static event Action<ScriptableRenderContext, Camera> beginCameraRendering;
        internal static void Begin(Camera camera) { if (beginCameraRendering != null) beginCameraRendering(new ScriptableRenderContext(), camera); }
    }

    public struct RenderTargetIdentifier
    {
        public RenderTargetIdentifier(Texture tex) { }
    }

    public sealed class CommandBuffer
    {
        internal MaterialPropertyBlock Properties;
        internal int Count;
        internal Rect Viewport;
        public string name { get; set; }
        public void Clear() { Properties = null; }
        public void SetViewport(Rect pixelRect) { Viewport = pixelRect; }
        public void Release() { }
        public void SetRenderTarget(RenderTargetIdentifier[] colors, RenderTargetIdentifier depth) { }
        public void ClearRenderTarget(bool clearDepth, bool clearColor, Color backgroundColor) { }
        public void DrawProcedural(GraphicsBuffer indexBuffer, Matrix4x4 matrix, Material material, int shaderPass, MeshTopology topology,
                                   int indexCount, int instanceCount, MaterialPropertyBlock properties)
        {
            Properties = properties;
            Count = indexCount;
        }
    }

    public enum GraphicsDeviceType { Vulkan }
    public enum IndexFormat { UInt16, UInt32 }
    public enum ShadowCastingMode { Off, On }
}
