using System;
using UnityEngine;

namespace Gsac
{
    /// <summary>What moves the joints.</summary>
    public enum GsacSource
    {
        /// <summary>The Animator, by any Humanoid clip, or whatever else turns the transforms.</summary>
        Animator,
        /// <summary>Pose and expressions set from script, from the inspector or by a pose stream.</summary>
        Script,
        /// <summary>A clip of the .gsac file.</summary>
        Clip,
    }

    /// <summary>
    /// A person: skeleton, poses, expressions. Drawn by the GsacRenderer beside it. Joint rotations in SMPL-X's numbers
    /// (axis-angle in radians, right-handed, y up, person facing +z, left = +x; zero = T-pose) or as Unity quaternions.
    /// </summary>
    [AddComponentMenu("Gsac/Gsac Avatar")]
    [DisallowMultipleComponent]
    [DefaultExecutionOrder(9000)]
    [ExecuteAlways]
    [RequireComponent(typeof(GsacRenderer))]
    public sealed class GsacAvatar : MonoBehaviour
    {
        const float Fade = 0.3f; // s

        [SerializeField, Tooltip("An imported .gsac file.")] GsacAsset asset = null;
        [SerializeField, Tooltip("Or a .gsac file whose name ends in .bytes.")] TextAsset bytes = null;
        [SerializeField] GsacSource source = GsacSource.Animator;
        [SerializeField, Tooltip("Clip of the file that plays when the source is Clip; the first where this is empty.")] string clip = "";

        GsacModel model;
        Transform[] joints;
        int jaw;
        Animator animator;
        Avatar built; // by this component, not a file's
        byte[] loose;
        GsacPose target;
        GsacPose shown;
        GsacPose before;
        GsacClip playing;
        float time;
        float faded = 1;

        /// <summary>Throws GsacException where the file cannot be read, InvalidOperationException where none is given.</summary>
        public GsacModel Model
        {
            get
            {
                if (model == null) Open();
                return model;
            }
        }

        public GsacData Data { get { return Model.Data; } }

        /// <summary>In the order of Data.JointNames.</summary>
        public Transform[] Joints { get { return Model == null ? null : joints; } }

        /// <summary>Weights by Data.Expressions that the next frame draws, the jaw's share added.</summary>
        public float[] DrawnWeights { get; private set; }

        /// <summary>Weights by Data.Expressions as set.</summary>
        public float[] Weights { get; private set; }

        /// <summary>The pose that the source Script shows. Change it and it is drawn.</summary>
        public GsacPose Pose { get { return Model == null ? null : target; } }

        public bool HasFile { get { return asset != null || bytes != null || loose != null; } }

        /// <summary>Whether the skeleton is there or may be made now: to a scene that is edited nothing is added.</summary>
        public bool CanOpen { get { return HasFile && (Application.isPlaying || transform.childCount > 0); } }

        public GsacSource Source
        {
            get { return source; }
            set
            {
                if (source != value) BeginFade();
                source = value;
            }
        }

        /// <summary>For the importer.</summary>
        public void Use(GsacAsset file)
        {
            Close();
            asset = file;
        }

        /// <summary>Another avatar from the bytes of a .gsac file, at run time. Throws GsacException.</summary>
        public void Use(byte[] file)
        {
            Close();
            foreach (Transform child in GetComponentsInChildren<Transform>(true))
            {
                if (child.parent != transform) continue;
                child.SetParent(null, false); // destroyed only at the frame's end
                Destroy(child.gameObject);
            }
            if (animator != null) animator.avatar = null;
            FreeBuilt();
            target = null;
            loose = file;
            Open();
        }

        void Open()
        {
            if (!HasFile) throw new InvalidOperationException(name + ": the Gsac Avatar has no file; drag a .gsac asset onto its field `Asset`");
            object origin = loose != null ? (object)loose : asset != null ? (object)asset : bytes;
            model = GsacModel.Acquire(origin, loose ?? (asset != null ? asset.Bytes : bytes.bytes));
            GsacData data = model.Data;
            joints = GsacSkeleton.Joints(data, transform);
            jaw = data.Joint("jaw");
            if (target == null)
            {
                target = new GsacPose(data.JointCount);
                shown = new GsacPose(data.JointCount);
                before = new GsacPose(data.JointCount);
                Weights = new float[data.Expressions.Length];
                DrawnWeights = new float[data.Expressions.Length];
                GsacSkeleton.Read(target, data, joints); // what the scene was saved with
            }
            animator = GetComponent<Animator>();
            if (animator == null) animator = gameObject.AddComponent<Animator>();
            if (animator.avatar == null) animator.avatar = built = GsacHumanoid.Build(data, gameObject, joints);
            FindClip();
        }

        void FindClip()
        {
            playing = null;
            foreach (GsacClip found in model.Data.Clips.Values)
            {
                if (playing == null || found.Name == clip) playing = found;
            }
        }

        void Close()
        {
            if (model != null) model.Release();
            model = null;
        }

        void FreeBuilt()
        {
            GsacCameras.Free(built);
            built = null;
        }

        void OnDisable()
        {
            Close();
        }

        void OnDestroy()
        {
            FreeBuilt();
        }

        /// <summary>"T" or "A", or another still pose of the file.</summary>
        public void ShowPose(string pose)
        {
            GsacClip still;
            if (!Data.Poses.TryGetValue(pose, out still)) throw Unknown("pose", pose);
            Source = GsacSource.Script;
            BeginFade();
            target.Sample(still, 0);
        }

        public void TPose()
        {
            ShowPose("T");
        }

        public void APose()
        {
            ShowPose("A");
        }

        /// <summary>Plays a clip of the file, such as "wave" or "walk".</summary>
        public void PlayClip(string name)
        {
            GsacClip found;
            if (!Data.Clips.TryGetValue(name, out found)) throw Unknown("clip", name);
            Source = GsacSource.Clip;
            BeginFade();
            playing = found;
            clip = name;
            time = 0;
        }

        /// <summary>One moment of a clip as a still pose.</summary>
        public void ShowMoment(string name, float seconds)
        {
            GsacClip found;
            if (!Data.Clips.TryGetValue(name, out found)) throw Unknown("clip", name);
            Source = GsacSource.Script;
            BeginFade();
            target.Sample(found, seconds);
        }

        /// <summary>Without a soft change from the pose before.</summary>
        public void SkipFade()
        {
            faded = 1;
        }

        /// <summary>SMPL-X's numbers; an array that is null stays as it is. Lengths: 3, 63, 45, 45, 3, 3, 3.</summary>
        public void SetSmplx(float[] globalOrient, float[] bodyPose, float[] leftHandPose = null, float[] rightHandPose = null,
                             float[] jawPose = null, float[] leftEyePose = null, float[] rightEyePose = null)
        {
            Source = GsacSource.Script;
            GsacPose pose = Pose;
            if (globalOrient != null) pose.SetSmplx(0, globalOrient);
            if (bodyPose != null) pose.SetSmplx(1, bodyPose);
            if (jawPose != null) pose.SetSmplx(22, jawPose);
            if (leftEyePose != null) pose.SetSmplx(23, leftEyePose);
            if (rightEyePose != null) pose.SetSmplx(24, rightEyePose);
            if (leftHandPose != null) pose.SetSmplx(25, leftHandPose);
            if (rightHandPose != null) pose.SetSmplx(40, rightHandPose);
        }

        /// <summary>A joint's rotation relative to its parent, SMPL-X's axis-angle.</summary>
        public void SetJoint(string joint, Vector3 axisAngle)
        {
            Source = GsacSource.Script;
            Pose.SetSmplx(JointIndex(joint), axisAngle.x, axisAngle.y, axisAngle.z);
        }

        /// <summary>A joint's local rotation in Unity's axes.</summary>
        public void SetJoint(string joint, Quaternion local)
        {
            Source = GsacSource.Script;
            int j = JointIndex(joint) * 4;
            Pose.Rotation[j] = local.x;
            Pose.Rotation[j + 1] = local.y;
            Pose.Rotation[j + 2] = local.z;
            Pose.Rotation[j + 3] = local.w;
        }

        int JointIndex(string joint)
        {
            int j = Data.Joint(joint);
            if (j < 0) throw Unknown("joint", joint);
            return j;
        }

        /// <summary>weight: 0..1, of one of Data.Expressions (ARKit's names, such as jawOpen).</summary>
        public void SetExpression(string name, float weight)
        {
            int e = Array.IndexOf(Data.Expressions, name);
            if (e < 0) throw Unknown("expression", name);
            Weights[e] = weight;
        }

        public void ClearExpressions()
        {
            if (Model != null) Array.Clear(Weights, 0, Weights.Length);
        }

        ArgumentException Unknown(string what, string word)
        {
            return new ArgumentException(name + " has no " + what + " `" + word + "`");
        }

        void BeginFade()
        {
            if (joints == null || !Application.isPlaying) return;
            GsacSkeleton.Read(before, Data, joints);
            faded = 0;
        }

        void LateUpdate()
        {
            if (!HasFile || !Application.isPlaying || Model == null) return;
            bool animated = source == GsacSource.Animator;
            if (animator.enabled != animated) animator.enabled = animated;
            Refresh(Time.deltaTime);
        }

        /// <summary>Moves the joints of this frame. LateUpdate calls it; in edit mode the inspector does.</summary>
        public void Refresh(float seconds)
        {
            if (Model == null || source == GsacSource.Animator) return;
            time += seconds;
            if (source == GsacSource.Clip && playing != null) shown.Sample(playing, time);
            else shown.Copy(target);
            if (faded < 1)
            {
                faded = Math.Min(1, faded + seconds / Fade);
                shown.MixFrom(before, faded * faded * (3 - 2 * faded));
            }
            GsacSkeleton.Apply(shown, model.Data, joints);
        }

        /// <summary>Fills DrawnWeights; the renderer calls it.</summary>
        public void CollectWeights()
        {
            Array.Copy(Weights, DrawnWeights, Weights.Length);
            if (jaw < 0) return;
            Quaternion q = joints[jaw].localRotation;
            GsacPose.AddJaw(model.Data, q.x, q.y, q.z, q.w, DrawnWeights);
        }
    }
}
