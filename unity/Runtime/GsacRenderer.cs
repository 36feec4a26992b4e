using System;
using System.Collections.Generic;
using UnityEngine;

namespace Gsac
{
    /// <summary>
    /// Draws a GsacAvatar, in every render pipeline: per frame skin and bind, per camera sort and one indexed draw among
    /// the transparent things. All on the GPU: nothing is read back, nothing is allocated after the first frame.
    /// </summary>
    [AddComponentMenu("Gsac/Gsac Renderer")]
    [DisallowMultipleComponent]
    [DefaultExecutionOrder(10000)]
    [ExecuteAlways]
    public sealed class GsacRenderer : MonoBehaviour
    {
        const int ThreadsPerGroup = 64;
        const float Slack = 0.9f;
        static readonly int VertexCountId = Shader.PropertyToID("GsacVertexCount");
        static readonly int SplatCountId = Shader.PropertyToID("GsacSplatCount");
        static readonly int RestId = Shader.PropertyToID("GsacRest");
        static readonly int PairsId = Shader.PropertyToID("GsacPairs");
        static readonly int FirstId = Shader.PropertyToID("GsacFirst");
        static readonly int TurnsId = Shader.PropertyToID("GsacTurns");
        static readonly int BentId = Shader.PropertyToID("GsacBent");
        static readonly int SkinId = Shader.PropertyToID("GsacSkin");
        static readonly int MovesId = Shader.PropertyToID("GsacMoves");
        static readonly int WeightsId = Shader.PropertyToID("GsacWeights");
        static readonly int BonesId = Shader.PropertyToID("GsacBones");
        static readonly int PosedId = Shader.PropertyToID("GsacPosed");
        static readonly int CornersId = Shader.PropertyToID("GsacCorners");
        static readonly int LocalId = Shader.PropertyToID("GsacLocal");
        static readonly int SplatsId = Shader.PropertyToID("GsacSplats");
        static readonly int[] LightIds =
        {
            Shader.PropertyToID("GsacLightRed"), Shader.PropertyToID("GsacLightGreen"), Shader.PropertyToID("GsacLightBlue"),
        };

        /// <summary>Cameras beyond those of the scene; the editor adds its scene views.</summary>
        public static readonly List<Camera> ExtraCameras = new List<Camera>();

        static Camera[] cameras = new Camera[8];

        [SerializeField, Tooltip("m: where coarser levels of detail begin, if the file does not say at which height; each doubling takes the next.")]
        float finestWithin = 8;

        [SerializeField, Tooltip("0..1: how far the avatar stands in the light of the room in which its clip was filmed; 0 is even light.")]
        float clipLight = 1;

        readonly List<GsacView> views = new List<GsacView>();
        GsacAvatar avatar;
        GsacModel model;
        ComputeShader kernels;
        int correctKernel, skinKernel, bindKernel;
        Material material;
        GraphicsBuffer bones, weights, posed, splats;
        GraphicsBuffer turns, bent; // null where the body has no pose correctives
        float[] turnRows;
        Vector4[] boneRows;
        int drawn;
        string trouble;

        /// <summary>m: where an avatar begins to use coarser levels of detail, if its file does not say at which height in px.</summary>
        public float FinestWithin
        {
            get { return finestWithin; }
            set { finestWithin = value; }
        }

        /// <summary>0..1: 1 draws the avatar in the light of its clip, 0 evenly lit. The light turns with the avatar's transform, not with its pose.</summary>
        public float ClipLight
        {
            get { return clipLight; }
            set { clipLight = value; }
        }

        void OnEnable()
        {
            trouble = null;
        }

        void OnDisable()
        {
            Drop();
        }

        void Drop()
        {
            foreach (GsacView view in views) view.Dispose();
            views.Clear();
            model = null;
            if (bones == null) return;
            bones.Dispose();
            weights.Dispose();
            posed.Dispose();
            splats.Dispose();
            if (bent != null)
            {
                turns.Dispose();
                bent.Dispose();
            }
            bones = turns = bent = null;
        }

        void LateUpdate()
        {
            if (avatar == null) avatar = GetComponent<GsacAvatar>();
            if (avatar == null || !avatar.isActiveAndEnabled || !avatar.CanOpen || trouble != null) return;
            try
            {
                if (!Ready()) return;
            }
            catch (GsacException e)
            {
                Complain(e.Message);
                return;
            }
            int count = Cameras();
            if (count == 0) return;
            GsacSkeleton.Bones(model.Data, transform, avatar.Joints, boneRows);
            GsacModel.Level level = model.Levels[Level(count)];
            if (level.Count == 0) return;
            Bind(level);
            float low, high;
            for (int i = 0; i < count; i++)
            {
                if (!IsSeenBy(cameras[i])) continue;
                GsacView view = View(cameras[i]);
                if (view.Depths(transform, boneRows, model, out low, out high)) view.Draw(kernels, splats, level, model, transform, low, high);
            }
        }

        /// <summary>Buffers of the avatar that is there now. False where this device cannot draw it.</summary>
        bool Ready()
        {
            return model != null && ReferenceEquals(model, avatar.Model) || Prepare();
        }

        bool Prepare()
        {
            if (!SystemInfo.supportsComputeShaders || SystemInfo.maxComputeBufferInputsVertex < 3)
            {
                Complain("this graphics API (" + SystemInfo.graphicsDeviceType + ") has no compute shaders or no buffers in vertex shaders;"
                         + " use Direct3D 11 or 12, Vulkan or Metal");
                return false;
            }
            Drop();
            model = avatar.Model;
            model.Upload();
            int V = model.Data.VertexCount, most = 1;
            foreach (GsacModel.Level level in model.Levels) most = Math.Max(most, level.Count);
            bones = GsacModel.Empty(model.Data.JointCount * 3, 4);
            weights = GsacModel.Empty(model.Data.Expressions.Length, 1);
            posed = GsacModel.Empty(V, 4);
            splats = GsacModel.Empty(most * 3, 4);
            boneRows = new Vector4[model.Data.JointCount * 3];
            if (model.Data.Correctives != null)
            {
                turns = GsacModel.Empty(model.Data.JointCount * 3, 4);
                bent = GsacModel.Empty(V, 4);
                turnRows = new float[model.Data.JointCount * 12];
            }
            kernels = Resources.Load<ComputeShader>("Gsac/Gsac");
            correctKernel = kernels.FindKernel("Correct");
            skinKernel = kernels.FindKernel("Skin");
            bindKernel = kernels.FindKernel("Bind");
            if (material == null) material = new Material(Resources.Load<Shader>("Gsac/GsacSplats")) { hideFlags = HideFlags.HideAndDontSave };
            return true;
        }

        void Complain(string what)
        {
            trouble = what;
            Debug.LogError(name + ": the avatar cannot be drawn: " + what, this);
        }

        void Bind(GsacModel.Level level)
        {
            avatar.CollectWeights();
            bones.SetData(boneRows);
            if (avatar.DrawnWeights.Length > 0) weights.SetData(avatar.DrawnWeights);
            kernels.SetInt(VertexCountId, model.Data.VertexCount);
            kernels.SetInt(SplatCountId, level.Count);
            if (bent != null) Correct();
            kernels.SetBuffer(skinKernel, RestId, bent ?? model.Rest);
            kernels.SetBuffer(skinKernel, SkinId, model.Skin);
            kernels.SetBuffer(skinKernel, MovesId, model.Moves);
            kernels.SetBuffer(skinKernel, WeightsId, weights);
            kernels.SetBuffer(skinKernel, BonesId, bones);
            kernels.SetBuffer(skinKernel, PosedId, posed);
            kernels.Dispatch(skinKernel, Groups(model.Data.VertexCount), 1, 1);
            float lit = model.Data.Light == null ? 0 : Mathf.Clamp(clipLight, 0, 1);
            for (int c = 0; c < 3; c++) kernels.SetVector(LightIds[c], Light(c, lit));
            kernels.SetBuffer(bindKernel, CornersId, level.Corners);
            kernels.SetBuffer(bindKernel, LocalId, level.Local);
            kernels.SetBuffer(bindKernel, PosedId, posed);
            kernels.SetBuffer(bindKernel, SplatsId, splats);
            kernels.Dispatch(bindKernel, Groups(level.Count), 1, 1);
        }

        /// <summary>Fills `bent`: the vertices at rest, as the pose's correctives move them.</summary>
        void Correct()
        {
            for (int j = 0; j < avatar.Joints.Length; j++)
            {
                Quaternion q = avatar.Joints[j].localRotation;
                GsacCorrectives.SetTurn(turnRows, j, q.x, q.y, q.z, q.w);
            }
            turns.SetData(turnRows);
            kernels.SetBuffer(correctKernel, RestId, model.Rest);
            kernels.SetBuffer(correctKernel, PairsId, model.Pairs);
            kernels.SetBuffer(correctKernel, FirstId, model.First);
            kernels.SetBuffer(correctKernel, TurnsId, turns);
            kernels.SetBuffer(correctKernel, BentId, bent);
            kernels.Dispatch(correctKernel, Groups(model.Data.VertexCount), 1, 1);
        }

        /// <summary>A channel's factors of a normal's x, y, |z| and of 1, between even light and the clip's.</summary>
        Vector4 Light(int channel, float lit)
        {
            if (lit == 0) return new Vector4(0, 0, 0, 1);
            float[] light = model.Data.Light;
            return new Vector4(lit * light[3 + channel], lit * light[6 + channel], lit * light[9 + channel], 1 - lit + lit * light[channel]);
        }

        static int Groups(int count)
        {
            return (count + ThreadsPerGroup - 1) / ThreadsPerGroup;
        }

        /// <summary>Fills `cameras` with those that are on; returns how many.</summary>
        static int Cameras()
        {
            int most = Camera.allCamerasCount + ExtraCameras.Count;
            if (cameras.Length < most) Grow(most * 2);
            int count = Camera.GetAllCameras(cameras);
            for (int i = 0; i < ExtraCameras.Count; i++)
            {
                if (ExtraCameras[i] != null) cameras[count++] = ExtraCameras[i];
            }
            return count;
        }

        static void Grow(int most)
        {
            cameras = new Camera[most];
        }

        bool IsSeenBy(Camera camera)
        {
            return (camera.cullingMask & (1 << gameObject.layer)) != 0;
        }

        /// <summary>
        /// Level of detail for the camera that sees the person largest; the one of before while that is about where they change.
        /// </summary>
        int Level(int count)
        {
            if (!model.Data.HasHeights) return LevelByDistance(count);
            float height = 0;
            for (int i = 0; i < count; i++)
            {
                if (IsSeenBy(cameras[i])) height = Math.Max(height, View(cameras[i]).Height(transform, boneRows, model));
            }
            return drawn = Math.Min(Math.Max(drawn, model.Data.LevelAt(height / Slack)), model.Data.LevelAt(height));
        }

        /// <summary>As Level, of files that say no heights: for the nearest camera.</summary>
        int LevelByDistance(int count)
        {
            float nearest = float.MaxValue;
            for (int i = 0; i < count; i++) nearest = Math.Min(nearest, Vector3.Distance(cameras[i].transform.position, transform.position));
            return drawn = Math.Min(Math.Max(drawn, LevelAt(nearest * Slack)), LevelAt(nearest));
        }

        int LevelAt(float distance)
        {
            int level = 0;
            for (float within = finestWithin; level + 1 < model.Levels.Length && distance > within; within *= 2) level++;
            return level;
        }

        GsacView View(Camera camera)
        {
            for (int i = views.Count - 1; i >= 0; i--)
            {
                if (views[i].Camera == camera) return views[i];
                if (views[i].Camera != null) continue;
                views[i].Dispose();
                views.RemoveAt(i);
            }
            return NewView(camera);
        }

        GsacView NewView(Camera camera)
        {
            var view = new GsacView(camera, material);
            views.Add(view);
            return view;
        }
    }
}
